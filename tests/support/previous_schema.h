// A state folder as the release before this one left it.
#pragma once

namespace lightloom::test {

/// Takes from a database what version 2 of the schema added to version 1.
inline constexpr const char* kBackToSchema1[] = {
    "DROP INDEX tasks_results",          "DROP INDEX tasks_spawned",
    "ALTER TABLE jobs DROP COLUMN work", "ALTER TABLE progress DROP COLUMN reused",
    "ALTER TABLE tasks DROP COLUMN key", "ALTER TABLE tasks DROP COLUMN spawner",
    "PRAGMA user_version = 1",
};

}  // namespace lightloom::test
