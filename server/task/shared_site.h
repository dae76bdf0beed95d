// Sites that sessions share. Making one takes long (Embree builds each surface), so one that is in
// use is used again for the same task, case, instruments and optic. From any thread that may wait.
#pragma once

#include "task/site.h"

struct site_pool;
struct shared_site;

struct site_pool *site_pool_create(void);
// All sites were released. NULL inside is fine; *pool becomes NULL.
void site_pool_destroy(struct site_pool **pool);

// The site keeps a copy of the file. Results as task_parse and site_create. The scene must outlive
// the site; the caller releases it.
enum result shared_site_take(struct site_pool *pool, const struct task_file *file,
                             const struct scene *scene, const struct instruments *tools,
                             const struct view_optic *optic, struct shared_site **out_site,
                             struct error *err);
void shared_site_release(struct shared_site **site); // NULL inside is fine; *site becomes NULL

const struct site *shared_site_site(const struct shared_site *site);
const struct task_file *shared_site_file(const struct shared_site *site);
