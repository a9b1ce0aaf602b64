#include "runtime/vulkan/upload.h"

#include <algorithm>
#include <cstring>

namespace lightloom {

void Staging::copy(VkCommandBuffer commands, VkBuffer to, uint64_t offset, const uint8_t* from, uint64_t bytes) {
  std::memcpy(buffer_->mapped() + at_, from, bytes);
  const VkBufferCopy copy{at_, offset, bytes};
  context_->vk.CmdCopyBuffer(commands, buffer_->handle(), to, 1, &copy);
  at_ += bytes;
}

void UploadQueue::cancel_all_but_newest(AssetIndex::Target target, size_t newest) {
  for (size_t i = 0; i + newest < uploads_.size(); ++i) {
    Upload& u = uploads_[i];
    if (u.target.kind == target.kind && u.target.index == target.index) u.cancelled = true;
  }
}

uint64_t UploadQueue::pending_bytes() const {
  uint64_t bytes = 0;
  for (const Upload& u : uploads_) bytes += u.cancelled ? 0 : u.zeros + u.data.size() - u.done;
  return bytes;
}

absl::Status ShadowTable::create(Context* context, uint64_t bytes, uint64_t unit, uint8_t value) {
  unit_ = unit;
  value_ = value;
  LL_ASSIGN_OR_RETURN(device_, Buffer::create(context, bytes, BufferUse::kDevice));
  host_.assign(bytes, value);
  return absl::OkStatus();
}

void ShadowTable::clear(VkCommandBuffer commands, const Context& context) const {
  if (host_.empty()) return;
  const uint32_t word = value_ * 0x01010101u;
  context.vk.CmdFillBuffer(commands, device_.handle(), 0, VK_WHOLE_SIZE, word);
}

void ShadowTable::touch(uint64_t begin, uint64_t end) {
  begin = begin / unit_ * unit_;
  if (begin_ == end_) {
    begin_ = begin;
    end_ = end;
  } else {
    begin_ = std::min(begin_, begin);
    end_ = std::max(end_, end);
  }
}

void ShadowTable::record(VkCommandBuffer commands, Staging* staging, uint64_t bytes) {
  const uint64_t part = std::min({end_ - begin_, bytes, staging->room()}) / unit_ * unit_;
  if (part == 0) return;
  staging->copy(commands, device_.handle(), begin_, host_.data() + begin_, part);
  begin_ += part;
}

}  // namespace lightloom
