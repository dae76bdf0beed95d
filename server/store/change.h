// What a transaction changes of the records that servers share (share.h). Private to this room. The
// functions give codes of SQLite.
#pragma once

#include "store/database.h"
#include "store/share.h"

// Begins to gather what is changed from now on. NULL where memory is short.
sqlite3_session *change_begin(sqlite3 *db);

// In a transaction that store_begin began: what it has changed so far becomes a change of this
// server.
enum result change_keep(struct store *store, struct error *err);

// Undoes what this server changed and the order has not, does `between`, and does its own again.
// Inside a transaction.
int change_do_between(sqlite3 *db, const struct store_change *between, bool *out_dropped);
// Does what this server changed and the order has not, in records that do not have it. Inside a
// transaction.
int change_do_all(sqlite3 *db);

// SQL: the records are this server's alone again.
extern const char share_end[];
