#include <cstdio>

#include "bake-server/commands/commands.h"
#include "bake-server/upkeep/backup.h"

namespace lightloom {

absl::Status backup(const std::string& state, const std::string& database, const std::string& to,
                    const CancelFlag& cancel) {
  LL_ASSIGN_OR_RETURN(const Backup copy, back_up(state, to, &cancel, database));
  std::printf("backed up to %s: %s\n", to.c_str(), backup_text(copy).c_str());
  return check_whole(copy, to);
}

}  // namespace lightloom
