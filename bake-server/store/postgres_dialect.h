// What the stores say, in SQLite's SQL, said to PostgreSQL.
#pragma once

#include <string>
#include <string_view>

namespace lightloom {

/// Of statements and schemas of this folder, which keep to what both have, but for: ?1 is $1; INDEXED BY, which makes SQLite
/// refuse to scan, is left out; CROSS JOIN, by which SQLite keeps the order of tables, is a JOIN; x'' is an empty BYTEA; types
/// have PostgreSQL's names, and texts compare by their bytes; rows that number themselves are identities; the schema's version
/// is a table of one row.
std::string to_postgres(std::string_view sql);

}  // namespace lightloom
