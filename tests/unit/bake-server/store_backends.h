// The implementations of Store.
#pragma once

#include <absl/strings/ascii.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "bake-server/store/postgres_store.h"
#include "bake-server/store/sqlite_store.h"
#include "tests/support/postgres_server.h"

namespace lightloom::test {

/// An implementation; opening the same folder again finds what was there.
struct StoreBackend {
  std::string name;
  std::function<absl::StatusOr<std::unique_ptr<Store>>(const std::filesystem::path&)> open;
};
inline std::ostream& operator<<(std::ostream& out, const StoreBackend& backend) { return out << backend.name; }

inline std::vector<StoreBackend> store_backends() {
  return {{"Sqlite", [](const std::filesystem::path& folder) { return open_sqlite_store(folder); }},
          {"Postgres", [](const std::filesystem::path& folder) {
             // A database for each folder, which has a name of its own.
             std::string name = folder.filename().string();
             std::replace(name.begin(), name.end(), '-', '_');
             for (char& c : name) c = absl::ascii_tolower(static_cast<unsigned char>(c));
             name += "_" + sha256(folder.string()).hex().substr(0, 8);
             return open_postgres_store(PostgresServer::shared().database(name));
           }}};
}

}  // namespace lightloom::test
