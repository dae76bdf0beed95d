// Doors of the rooms that have no part in a simulation: keys and certificates, the local console,
// the watchdog, the log; and cases, which are loaded once for all runs.
#include "base/check.h"
#include "base/log.h"
#include "link/renewal.h"
#include "link/trust.h"
#include "net/console.h"
#include "net/signer.h"
#include "runtime/watchdog.h"
#include "sim/hall.h"
#include "sim/report.h"
#include "sim/threads.h"
#include "step/scene.h"
#include "store/store.h"
#include "websocket/tls_files.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

// ---- keys ---------------------------------------------------------------------------------------

static char nothing; // what stands for a thing that is never looked at

enum result __wrap_trust_init(struct trust *trust, const char *dir, struct error *err);
enum result __wrap_trust_init(struct trust *trust, const char *dir, struct error *err) {
    (void)dir, (void)err;
    *trust = (struct trust){0};
    return RESULT_OK;
}

enum result __wrap_trust_expect(struct trust *trust, const char *host, struct error *err);
enum result __wrap_trust_expect(struct trust *trust, const char *host, struct error *err) {
    (void)err;
    trust->host = host;
    return RESULT_OK;
}

void __wrap_trust_fini(struct trust *trust);
void __wrap_trust_fini(struct trust *trust) {
    (void)trust;
}

struct renewal *__wrap_renewal_create(const struct link_config *config,
                                      const struct renewal_handler *handler);
struct renewal *__wrap_renewal_create(const struct link_config *config,
                                      const struct renewal_handler *handler) {
    (void)config, (void)handler;
    return NULL;
}

void __wrap_renewal_destroy(struct renewal **renewal);
void __wrap_renewal_destroy(struct renewal **renewal) {
    (void)renewal;
}

enum result __wrap_tls_files_create(const char *certificate, const char *key,
                                    struct tls_files **out_files,
                                    struct tls_credentials **out_credentials, struct error *err);
enum result __wrap_tls_files_create(const char *certificate, const char *key,
                                    struct tls_files **out_files,
                                    struct tls_credentials **out_credentials, struct error *err) {
    (void)certificate, (void)key, (void)err;
    CHECK(!out_credentials);
    *out_files = (struct tls_files *)&nothing;
    return RESULT_OK;
}

void __wrap_tls_files_destroy(struct tls_files **files);
void __wrap_tls_files_destroy(struct tls_files **files) {
    *files = NULL;
}

struct tls_credentials *__wrap_tls_files_look(struct tls_files *files);
struct tls_credentials *__wrap_tls_files_look(struct tls_files *files) {
    (void)files;
    return NULL;
}

void __wrap_tls_files_warn(struct tls_files *files, const char *room, const char *advice);
void __wrap_tls_files_warn(struct tls_files *files, const char *room, const char *advice) {
    (void)files, (void)room, (void)advice;
}

enum result __wrap_authority_used(const char *dir, const char *station, const char *serial,
                                  int *out_revoked, struct error *err);
enum result __wrap_authority_used(const char *dir, const char *station, const char *serial,
                                  int *out_revoked, struct error *err) {
    (void)dir, (void)station, (void)serial, (void)err;
    *out_revoked = 0;
    return RESULT_OK;
}

enum result __wrap_signer_create(const char *dir, struct signer **out_signer, struct error *err);
enum result __wrap_signer_create(const char *dir, struct signer **out_signer, struct error *err) {
    (void)dir, (void)err;
    *out_signer = (struct signer *)&nothing;
    return RESULT_OK;
}

void __wrap_signer_destroy(struct signer **signer);
void __wrap_signer_destroy(struct signer **signer) {
    *signer = NULL;
}

// A real signature has another length each time, and the same seed must give the same bytes.
bool __wrap_signer_sign(void *signer, const uint8_t *message, size_t size, uint8_t *out_certificate,
                        size_t *in_out_certificate_size, uint8_t *out_signature,
                        size_t *in_out_signature_size);
bool __wrap_signer_sign(void *signer, const uint8_t *message, size_t size, uint8_t *out_certificate,
                        size_t *in_out_certificate_size, uint8_t *out_signature,
                        size_t *in_out_signature_size) {
    (void)signer;
    *in_out_certificate_size = 400;
    *in_out_signature_size = 70;
    memset(out_certificate, 1, *in_out_certificate_size);
    memset(out_signature, 2, *in_out_signature_size);
    memcpy(out_signature, message, size < 70 ? size : 70);
    return true;
}

// ---- the console --------------------------------------------------------------------------------

enum result __wrap_console_create(const char *path, const struct console_handler *handler,
                                  struct console **out_console, struct error *err);
enum result __wrap_console_create(const char *path, const struct console_handler *handler,
                                  struct console **out_console, struct error *err) {
    (void)path, (void)handler, (void)err;
    *out_console = (struct console *)&nothing;
    return RESULT_OK;
}

void __wrap_console_destroy(struct console **console);
void __wrap_console_destroy(struct console **console) {
    *console = NULL;
}

// ---- records ------------------------------------------------------------------------------------

// The database is real, and whole after every write.
enum result __real_store_open(const char *path, enum store_mode mode, const char *actor,
                              struct store **out_store, struct error *err);
enum result __wrap_store_open(const char *path, enum store_mode mode, const char *actor,
                              struct store **out_store, struct error *err);
enum result __wrap_store_open(const char *path, enum store_mode mode, const char *actor,
                              struct store **out_store, struct error *err) {
    *out_store = NULL;
    if (sim_is_dead())
        return fail(err, RESULT_IO, "%s: the server was killed", path);
    return __real_store_open(path, mode, actor, out_store, err);
}

// ---- the watchdog -------------------------------------------------------------------------------

// It asks the system about real threads.
struct watchdog *__wrap_watchdog_create(const struct watched *watched, int count,
                                        const char *(*name)(const void *user, int station),
                                        const void *user);
struct watchdog *__wrap_watchdog_create(const struct watched *watched, int count,
                                        const char *(*name)(const void *user, int station),
                                        const void *user) {
    (void)watched, (void)count, (void)name, (void)user;
    return NULL;
}

void __wrap_watchdog_destroy(struct watchdog **watchdog);
void __wrap_watchdog_destroy(struct watchdog **watchdog) {
    *watchdog = NULL;
}

// ---- the log ------------------------------------------------------------------------------------

void __wrap_log_write(enum log_level level, const char *room, const char *format, ...);
void __wrap_log_write(enum log_level level, const char *room, const char *format, ...) {
    char text[160];
    const struct sim_process *process = sim_process();
    if (level > LOG_INFO || !process || process->dead)
        return;
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    if (process->index == SIM_SERVER)
        happened("server %s: %s", room, text);
    else
        happened("room-%d %s: %s", process->index + 1, room, text);
}

// ---- cases --------------------------------------------------------------------------------------

static struct scene *loaded;

enum result __real_scene_create(struct knee_case **knee, struct scene **out_scene,
                                struct error *err);
enum result __wrap_scene_create(struct knee_case **knee, struct scene **out_scene,
                                struct error *err);
enum result __wrap_scene_create(struct knee_case **knee, struct scene **out_scene,
                                struct error *err) {
    enum result result = loaded ? RESULT_OK : __real_scene_create(knee, &loaded, err);
    *out_scene = loaded;
    return result;
}

void __wrap_scene_destroy(struct scene **scene);
void __wrap_scene_destroy(struct scene **scene) {
    *scene = NULL;
}

const struct scene *sim_scene(void) {
    return loaded;
}
