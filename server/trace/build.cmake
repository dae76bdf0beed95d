# Writes OUT: a C file with the identity of the kernels, the SHA-1 of the compiled LIBRARIES.
foreach(library ${LIBRARIES})
  file(SHA1 ${library} hash)
  string(APPEND hashes ${hash})
endforeach()
string(SHA1 identity "${hashes}")
file(WRITE ${OUT} "extern const char trace_build[];\nconst char trace_build[] = \"${identity}\";\n")
