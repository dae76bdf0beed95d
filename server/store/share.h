// Records that several servers share. What a transaction writes becomes a change, which is kept in
// the same transaction. The changes of all servers come into one order outside of this room, and
// each server applies all of them in it, its own too. So all servers come to have the same rows.
//
// A server's own rows are there at once. If changes of others come before them in the order, its
// own are undone, and done again behind them. Where changes contradict each other, the first in the
// order counts:
//
//     a row that another change has removed      stays removed
//     somebody who was erased                    stays erased
//     fields that two servers have changed       have the later values
//     a row that is removed, but referred to     those that refer to it are removed, too
//     a row that refers to one that was removed  the change is dropped, all of it
//     a name or number that is taken             the later change is dropped, all of it
//
// Entries of the audit log are never dropped: each server has a chain of them (store.h).
//
// The way of undoing what came too early is that of Bayou (Terry et al., SOSP 1995). The changes
// are those of SQLite's session extension.
#pragma once

#include "store/store.h"

#include <stddef.h>

#define STORE_SERVERS_MAX 64

// A server among those that share records by one order of changes.
struct store_member {
    char server[STORE_NAME_MAX]; // its name; empty: the records are its alone
    char order[STORE_ID_MAX];    // a name for the order, never given twice
    char file[STORE_ID_MAX];     // the same for the file of its records
    int slot;                    // its number, from 0
};

struct store_share {
    struct store_member self;
    int64_t applied; // the place in the order up to which changes are applied
};

// The version of the tables: an older program cannot apply changes of newer ones.
int store_table_version(void);

bool store_is_member(const struct store_share *share, const struct store_member *member);

enum result store_share(struct store *store, struct store_share *out_share, struct error *err);

// The records of this server become those that others share from now on.
enum result store_share_begin(struct store *store, const struct store_member *self,
                              struct error *err);

// They become this server's alone again, as after a restore. What others have not got yet stays
// here.
enum result store_share_end(struct store *store, struct error *err);

struct store_change {
    int slot;       // of the server that made it
    int64_t number; // from 1, counted by that server
    int piece;      // of its bytes, from 0
    bool goes_on;   // there is another piece
    const uint8_t *bytes;
    size_t size;
};

// The first change of this server behind this number that is not in the order yet, as far as this
// file knows. RESULT_MISSING: there is none. The caller frees *out_bytes.
enum result store_own_change(struct store *store, int64_t behind, int64_t *out_number,
                             uint8_t **out_bytes, size_t *out_size, struct error *err);

// Whether changes of this server removed somebody's data, are in the order, and others have not
// forgotten what was before.
enum result store_has_erased(struct store *store, bool *out_has, struct error *err);
// They have, up to this place.
enum result store_forgotten(struct store *store, struct error *err);

// Applies the next piece of the order. One that was applied already is passed over. *out_dropped:
// the change contradicts the records, and was not applied. RESULT_MISSING: a change or piece before
// it never came. RESULT_REFUSED: this file is an older copy of itself, and has to join anew.
enum result store_apply(struct store *store, const struct store_change *change, int64_t place,
                        bool *out_dropped, struct error *err);

// Copies the records as of *out_place in the order into a new file. RESULT_TIMEOUT: this server has
// changes that are not in the order yet.
enum result store_share_copy(struct store *store, const char *path, int64_t *out_place,
                             struct error *err);

// Replaces the records at `path` by such a copy, in one step, after it has checked the copy.
// Changes of this server that the copy lacks stay, if the file is that of this member already. Any
// other file is kept beside it; its path is in out_aside (else empty).
enum result store_share_load(const char *copy, const char *path, const struct store_member *self,
                             char out_aside[STORE_TEXT_MAX], struct error *err);
