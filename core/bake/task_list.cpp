#include "core/bake/task_list.h"

#include <string_view>

#include "core/base/bytes.h"

namespace lightloom {
namespace {

constexpr uint32_t kMagic = 0x4c54424cu;  // "LBTL"
constexpr uint32_t kVersion = 1;

struct Header {
  uint32_t magic, version, tasks, reserved;
};
struct TaskRecord {
  uint32_t kind_bytes, argument_bytes, outputs, reserved;
};
static_assert(sizeof(Header) == 16 && sizeof(TaskRecord) == 16 && sizeof(Digest) == 32);

absl::Status corrupt(std::string_view why) {
  return absl::DataLossError("task list is corrupt: " + std::string(why) + "; run the task again");
}

}  // namespace

std::vector<uint8_t> encode_task_list(const std::vector<FinishedTask>& tasks) {
  std::vector<TaskRecord> records;
  std::vector<uint8_t> text;
  std::vector<Digest> outputs;
  for (const FinishedTask& t : tasks) {
    records.push_back({static_cast<uint32_t>(t.kind.size()), static_cast<uint32_t>(t.argument.size()),
                       static_cast<uint32_t>(t.outputs.size()), 0});
    text.insert(text.end(), t.kind.begin(), t.kind.end());
    text.insert(text.end(), t.argument.begin(), t.argument.end());
    outputs.insert(outputs.end(), t.outputs.begin(), t.outputs.end());
  }
  ByteWriter w;
  w.value(Header{kMagic, kVersion, static_cast<uint32_t>(tasks.size()), 0});
  w.array(records);
  w.array(text);
  w.array(outputs);
  return std::move(w).take();
}

absl::StatusOr<std::vector<FinishedTask>> decode_task_list(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<Header>();
  if (header.magic != kMagic) return corrupt("it does not start with LBTL");
  if (header.version != kVersion) return corrupt("version " + std::to_string(header.version) + " is unknown");
  const auto records = r.array<TaskRecord>(header.tasks);
  uint64_t text_bytes = 0, outputs = 0;
  for (const TaskRecord& t : records) {
    if (t.kind_bytes == 0) return corrupt("a task has no kind");
    text_bytes += uint64_t{t.kind_bytes} + t.argument_bytes;
    outputs += t.outputs;
  }
  const auto text = r.array<uint8_t>(text_bytes);
  const auto digests = r.array<Digest>(outputs);
  if (!r.at_end()) return corrupt("its length does not match its counts");

  std::vector<FinishedTask> tasks;
  auto at = text.begin();
  auto output = digests.begin();
  for (const TaskRecord& t : records) {
    const auto argument = at + t.kind_bytes, end = argument + t.argument_bytes;
    tasks.push_back({std::string(at, argument), {argument, end}, {output, output + t.outputs}});
    at = end;
    output += t.outputs;
  }
  return tasks;
}

}  // namespace lightloom
