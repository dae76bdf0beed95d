#include "live/account.h"

#include "store/store.h"

#include <string.h>

bool is_trainee(const struct live_account *account) {
    return !strcmp(account->role, store_role_name(ROLE_TRAINEE));
}

bool is_same_person(const struct live_account *a, const struct live_account *b) {
    if (is_trainee(a) != is_trainee(b))
        return false;
    return a->trainee[0] || b->trainee[0] ? !strcmp(a->trainee, b->trainee)
                                          : !strcmp(a->name, b->name);
}
