// A station's certificate: a key of its own, and a certificate for it in exchange for a one-time
// code, or for the certificate that it has.
#include "link/enrol.h"

#include "base/check.h"
#include "link/key_files.h"
#include "link/trouble.h"
#include "link/trust.h"

#include <libwebsockets.h>
#include <openssl/crypto.h>
#include <openssl/ec.h>
#include <openssl/x509.h>
#include <string.h>

#define ENROL_PATIENCE_US (15 * LWS_USEC_PER_SEC)
#define STOP_US (100 * LWS_US_PER_MS) // how often it is looked whether the caller stops

struct enrol_client {
    const char *host;
    int port;
    struct trust trust;
    struct lws_context *context;
    lws_sorted_usec_list_t patience, stop;
    const atomic_bool *stopping; // of the caller; NULL: it does not stop
    bool done;
    enum result result;
    struct error *err;
    uint8_t header[LWS_PRE]; // libwebsockets writes its own before the request
    uint8_t request[WIRE_CONTROL_MAX];
    size_t request_size, used;
    uint8_t answer[WIRE_CONTROL_MAX];
    arthron_Enrolled enrolled;
};

// ---- the conversation ---------------------------------------------------------------------------

static void finish(struct enrol_client *e, enum result result, const char *text) {
    if (e->done)
        return;
    e->done = true;
    e->result = result;
    if (result != RESULT_OK)
        fail(e->err, result, "%s, port %d: %s", e->host, e->port, text);
}

static void give_up(struct enrol_client *e, const char *why) {
    bool distrusted = e->trust.problem[0];
    finish(e, distrusted && !e->trust.clock_is_wrong ? RESULT_REFUSED : RESULT_IO,
           distrusted ? e->trust.problem : why);
}

static void read_answer(struct enrol_client *e) {
    arthron_Control message;
    struct error err;
    if (wire_decode_control(e->answer, e->used, &message, &err) != RESULT_OK) {
        finish(e, RESULT_FORMAT, err.text);
    } else if (message.which_message == arthron_Control_enrolled_tag) {
        e->enrolled = message.message.enrolled;
        finish(e, RESULT_OK, NULL);
    } else if (message.which_message == arthron_Control_refusal_tag) {
        const arthron_Refusal *refusal = &message.message.refusal;
        bool passes = refusal->reason == arthron_Refusal_Reason_BUSY ||
                      refusal->reason == arthron_Refusal_Reason_SHUTDOWN;
        finish(e, passes ? RESULT_CLOSED : RESULT_REFUSED, refusal->text);
    } else {
        finish(e, RESULT_FORMAT, "the server answered without a certificate");
    }
}

static int hear_enrolment(struct enrol_client *e, struct lws *socket, const void *bytes,
                          size_t size) {
    if (size > sizeof e->answer - e->used) {
        finish(e, RESULT_LIMIT, "the server's answer is too long");
        return -1;
    }
    memcpy(e->answer + e->used, bytes, size);
    e->used += size;
    if (!lws_remaining_packet_payload(socket) && lws_is_final_fragment(socket))
        read_answer(e);
    return e->done ? -1 : 0;
}

static int ask_certificate(struct enrol_client *e, struct lws *socket) {
    size_t size = e->request_size;
    e->request_size = 0;
    return size && lws_write(socket, e->request, size, LWS_WRITE_BINARY) < (int)size ? -1 : 0;
}

static int on_enrol_event(struct lws *socket, enum lws_callback_reasons reason, void *user,
                          void *bytes, size_t size) {
    (void)user;
    struct enrol_client *e = lws_context_user(lws_get_context(socket));
    switch (reason) {
    case LWS_CALLBACK_CLIENT_ESTABLISHED:
        lws_callback_on_writable(socket);
        return 0;
    case LWS_CALLBACK_CLIENT_WRITEABLE:
        return ask_certificate(e, socket);
    case LWS_CALLBACK_CLIENT_RECEIVE:
        return hear_enrolment(e, socket, bytes, size);
    case LWS_CALLBACK_CLIENT_CONNECTION_ERROR:
        give_up(e, trouble_sentence(bytes));
        return 0;
    case LWS_CALLBACK_WSI_DESTROY: // the one event that every end of a connection has
        give_up(e, trouble_sentence("Closed before conn"));
        return 0;
    default:
        return 0;
    }
}

static void lose_enrol_patience(lws_sorted_usec_list_t *patience) {
    finish(lws_container_of(patience, struct enrol_client, patience), RESULT_TIMEOUT,
           "no answer within 15 s");
}

static void look_for_stop(lws_sorted_usec_list_t *stop) {
    struct enrol_client *e = lws_container_of(stop, struct enrol_client, stop);
    if (atomic_load(e->stopping))
        finish(e, RESULT_CLOSED, "the station stops");
    else
        lws_sul_schedule(e->context, 0, &e->stop, look_for_stop, STOP_US);
}

static void converse(struct enrol_client *e) {
    static const struct lws_protocols protocols[] = {
        {.name = WIRE_ENROL_SUBPROTOCOL, .callback = on_enrol_event},
        {0},
    };
    struct lws_context_creation_info info = {
        .port = CONTEXT_PORT_NO_LISTEN,
        .protocols = protocols,
        .provided_client_ssl_ctx = e->trust.context,
        .options = LWS_SERVER_OPTION_DO_SSL_GLOBAL_INIT,
        .user = e,
        .gid = -1,
        .uid = -1,
    };
    lws_set_log_level(0, NULL);
    e->context = lws_create_context(&info);
    NEED(e->context, "memory");
    struct lws_client_connect_info to = {
        .context = e->context,
        .address = e->host,
        .port = e->port,
        .host = e->host,
        .origin = e->host,
        .path = "/",
        .protocol = WIRE_ENROL_SUBPROTOCOL,
        .alpn = "http/1.1",
        // trust.c checks the name, for addresses too
        .ssl_connection = LCCSCF_USE_SSL | LCCSCF_SKIP_SERVER_CERT_HOSTNAME_CHECK,
    };
    lws_sul_schedule(e->context, 0, &e->patience, lose_enrol_patience, ENROL_PATIENCE_US);
    if (e->stopping)
        lws_sul_schedule(e->context, 0, &e->stop, look_for_stop, STOP_US);
    if (!lws_client_connect_via_info(&to))
        finish(e, RESULT_IO, trouble_sentence(NULL));
    while (!e->done)
        lws_service(e->context, 0);
    lws_context_destroy(e->context);
}

// ---- the request --------------------------------------------------------------------------------

static size_t encode_request(EVP_PKEY *key, const char *station, uint8_t *der, size_t size) {
    X509_REQ *request = X509_REQ_new();
    NEED(request, "memory");
    X509_NAME *name = X509_REQ_get_subject_name(request);
    int made = X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_UTF8, (const uint8_t *)station, -1,
                                          -1, 0) == 1 &&
               X509_REQ_set_pubkey(request, key) == 1 &&
               X509_REQ_sign(request, key, EVP_sha256()) > 0;
    int length = made ? i2d_X509_REQ(request, NULL) : 0;
    if (length > 0 && (size_t)length <= size)
        i2d_X509_REQ(request, &der);
    X509_REQ_free(request);
    return length > 0 && (size_t)length <= size ? (size_t)length : 0;
}

static enum result prepare_enrolment(struct enrol_client *e, const char *code, const char *station,
                                     EVP_PKEY *key, struct error *err) {
    arthron_Control message = {.which_message = arthron_Control_enrol_tag};
    arthron_Enrol *enrol = &message.message.enrol;
    size_t size =
        encode_request(key, station, enrol->request_der.bytes, sizeof enrol->request_der.bytes);
    if (!size || strlen(code) >= sizeof enrol->code)
        return fail(err, RESULT_INVALID, "'%s' cannot be the name of a station", station);
    enrol->request_der.size = (pb_size_t)size;
    strcpy(enrol->code, code);
    return wire_encode_control(&message, e->request, sizeof e->request, &e->request_size);
}

// ---- the answer ---------------------------------------------------------------------------------

static X509 *read_der(const uint8_t *der, size_t size) {
    return d2i_X509(NULL, &der, (long)size);
}

static bool is_named_authority(const struct enrol_client *e) {
    uint8_t fingerprint[CODE_FINGERPRINT_SIZE];
    code_fingerprint(e->enrolled.authority_der.bytes, e->enrolled.authority_der.size, fingerprint);
    return !CRYPTO_memcmp(fingerprint, e->trust.code->fingerprint, sizeof fingerprint);
}

static enum result check_answer(const struct enrol_client *e, EVP_PKEY *key, X509 *certificate,
                                X509 *authority, struct error *err) {
    if (!certificate || !authority || X509_check_private_key(certificate, key) != 1)
        return fail(err, RESULT_FORMAT, "the server sent no certificate for this station's key");
    if (e->trust.code && !is_named_authority(e))
        return fail(err, RESULT_REFUSED,
                    "the server sent an authority that the code does not name");
    return RESULT_OK;
}

static enum result write_files(const struct enrol_client *e, EVP_PKEY *key, const char *dir,
                               struct error *err) {
    X509 *certificate =
        read_der(e->enrolled.certificate_der.bytes, e->enrolled.certificate_der.size);
    X509 *authority = read_der(e->enrolled.authority_der.bytes, e->enrolled.authority_der.size);
    enum result result = check_answer(e, key, certificate, authority, err);
    if (result == RESULT_OK)
        result = key_files_write(dir, key, certificate, e->trust.code ? authority : NULL, err);
    X509_free(certificate);
    X509_free(authority);
    return result;
}

// With whom the server is trusted by: code "" for the certificate that trust has.
static enum result exchange(struct enrol_client *e, const char *code, const char *station,
                            const char *keys_dir, struct error *err) {
    EVP_PKEY *key = EVP_EC_gen("P-256");
    NEED(key, "memory");
    enum result result = key_files_can_write(keys_dir, err); // a code serves once
    if (result == RESULT_OK)
        result = trust_expect(&e->trust, e->host, err);
    if (result == RESULT_OK)
        result = prepare_enrolment(e, code, station, key, err);
    if (result == RESULT_OK) {
        converse(e);
        result = e->result;
    }
    if (result == RESULT_OK)
        result = write_files(e, key, keys_dir, err);
    EVP_PKEY_free(key);
    trust_fini(&e->trust);
    return result;
}

enum result link_enrol(const char *host, int port, const char *code_text, const char *station,
                       const char *keys_dir, struct error *err) {
    struct enrol_client e = {.host = host, .port = port, .err = err};
    struct code code;
    enum result result = code_read(code_text, &code, err);
    if (result != RESULT_OK)
        return result;
    trust_init_code(&e.trust, &code);
    return exchange(&e, code_text, station, keys_dir, err);
}

enum result enrol_again(const struct link_config *config, const struct server_address *server,
                        const atomic_bool *stopping, struct error *err) {
    struct enrol_client e = {
        .host = server->host, .port = server->port, .stopping = stopping, .err = err};
    enum result result = trust_init(&e.trust, config->keys_dir, err);
    return result == RESULT_OK ? exchange(&e, "", config->station, config->keys_dir, err) : result;
}
