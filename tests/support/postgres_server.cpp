#include "tests/support/postgres_server.h"

#include <absl/strings/str_cat.h>
#include <libpq-fe.h>
#include <pwd.h>
#include <stdlib.h>

#include <algorithm>
#include <vector>

namespace lightloom::test {
namespace {

namespace fs = std::filesystem;

/// Where Debian puts the newest one's programs.
fs::path programs() {
  std::error_code none;
  std::vector<fs::path> found;
  for (const auto& version : fs::directory_iterator("/usr/lib/postgresql", none)) {
    if (fs::exists(version.path() / "bin/initdb", none)) found.push_back(version.path() / "bin");
  }
  return found.empty() ? fs::path() : *std::max_element(found.begin(), found.end());
}

void run(const std::vector<std::string>& command) {
  Process process(command);
  process.line([](const std::string&) { return false; });
  LL_CHECK(process.wait() == 0);
}

}  // namespace

PostgresServer& PostgresServer::shared() {
  static PostgresServer server;
  return server;
}

PostgresServer::PostgresServer() {
  std::string name = "/tmp/lightloom-pg-XXXXXX";  // short: a socket's path has little room
  LL_CHECK(::mkdtemp(name.data()) != nullptr);
  folder_ = name;
  if (::geteuid() == 0) {
    const passwd* const user = ::getpwnam("postgres");
    LL_CHECK(user != nullptr && ::chown(name.c_str(), user->pw_uid, user->pw_gid) == 0);
  }
  run(as_user({programs() / "initdb", "--pgdata", folder_ / "data", "--auth=trust", "--username=postgres", "--no-sync",
               "--encoding=UTF8", "--locale=C"}));
  start();
}

PostgresServer::~PostgresServer() {
  server_->signal(SIGINT);  // fast shutdown
  server_->wait();
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

std::vector<std::string> PostgresServer::as_user(std::vector<std::string> command) const {
  if (::geteuid() != 0) return command;
  std::vector<std::string> all = {"/usr/bin/setpriv", "--reuid=postgres", "--regid=postgres", "--clear-groups"};
  all.insert(all.end(), command.begin(), command.end());
  return all;
}

void PostgresServer::start() {
  const std::string ready = "database system is ready to accept connections";
  // After a crash a new one waits until the last process of the old one has gone.
  do {
    server_ = std::make_unique<Process>(
        as_user({programs() / "postgres", "-D", folder_ / "data", "-k", folder_, "-h", "", "-c", "max_connections=50",
                 "-c", "log_min_messages=log", "-c", "log_checkpoints=off"}));
  } while (server_->line([&](const std::string& line) { return line.find(ready) != std::string::npos; }).empty());
}

std::string PostgresServer::database(const std::string& name) {
  const auto address = [&](const std::string& of) {
    return absl::StrCat("host=", folder_.string(), " user=postgres dbname=", of);
  };
  PGconn* const connection = PQconnectdb(address("postgres").c_str());
  LL_CHECK(PQstatus(connection) == CONNECTION_OK);
  PQclear(PQexec(connection, ("CREATE DATABASE " + name).c_str()));  // an error: it is there
  PQfinish(connection);
  return address(name);
}

void PostgresServer::crash() {
  server_.reset();  // SIGKILL
  start();
}

}  // namespace lightloom::test
