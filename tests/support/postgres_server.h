// A PostgreSQL server of a test's own.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "tests/support/process.h"

namespace lightloom::test {

/// Initialised in a new temporary folder, and ended and removed with the object. It listens on a socket there, and on no port. As
/// root it runs as the user postgres, for it refuses to be root.
class PostgresServer {
 public:
  PostgresServer();
  ~PostgresServer();
  PostgresServer(const PostgresServer&) = delete;
  PostgresServer& operator=(const PostgresServer&) = delete;

  /// Of this process; started when it is first asked for, ended when the process ends.
  static PostgresServer& shared();

  /// An address of the database, which is made if it is not there. `name`: lower-case letters, digits and _.
  std::string database(const std::string& name);
  /// SIGKILL, then starts it again: what was committed is there.
  void crash();

 private:
  std::vector<std::string> as_user(std::vector<std::string> command) const;
  void start();

  std::filesystem::path folder_;
  std::unique_ptr<Process> server_;
};

}  // namespace lightloom::test
