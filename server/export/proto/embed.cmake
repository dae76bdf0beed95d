# Writes OUT: a C file with the bytes of the file IN.
file(READ ${IN} bytes HEX)
string(REGEX REPLACE "(..)" "0x\\1," bytes "${bytes}")
string(REGEX REPLACE "(0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,0x..,)" "\\1\n" bytes
       "${bytes}")
file(WRITE ${OUT} "#include <stddef.h>\n#include <stdint.h>\n\n"
     "extern const uint8_t mcap_schemas[];\nextern const size_t mcap_schemas_size;\n\n"
     "const uint8_t mcap_schemas[] = {\n${bytes}};\nconst size_t mcap_schemas_size = sizeof mcap_schemas;\n")
