// Networks that cut, delay, spoil and part, and disks that spoil.
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <random>

#include "tests/faults/broken_farm.h"
#include "tests/support/tcp_proxy.h"

namespace lightloom::test {
namespace {

class Network : public BrokenFarm {
 protected:
  void SetUp() override {
    BrokenFarm::SetUp();
    start_server();
  }
  /// Bakes a level, clients and workers all by way of `meddle`.
  void bake_through(const TcpProxy::Meddle& meddle) {
    const TcpProxy proxy(address_, meddle);
    worker_server_ = proxy.address();
    start_worker("a");
    start_worker("b");
    const std::string direct = address_;
    address_ = proxy.address();
    const RemoteJob job = submit(0);
    const RemoteJob ended = watch(job.id);
    EXPECT_EQ(ended.state, "done") << ended.error;
    const absl::Status fetched = fetch(job.id);
    EXPECT_TRUE(fetched.ok()) << fetched;
    address_ = direct;
    expect_whole(job.id, 0);
    workers_.clear();
  }

  std::mt19937 random_{1};
};

/// Requests, and replies to requests that were heard: what is said again was done already.
TEST_F(Network, ConnectionsAreCutAndSlow) {
  int slow = 0;
  bake_through([&](std::span<char>, bool) {
    if (random_() % 16 == 0) {
      ++slow;
      std::this_thread::sleep_for(std::chrono::milliseconds(random_() % 20));
    }
    if (random_() % 24 != 0) return TcpProxy::Go::kOn;
    ++faults_;
    return TcpProxy::Go::kCut;
  });
  std::printf("%d pieces were late\n", slow);
  EXPECT_GE(faults_, 10);
  EXPECT_GE(slow, 10);
}

/// One byte of long pieces, which are blobs.
TEST_F(Network, BlobsAreSpoiltOnTheWay) {
  bake_through([&](std::span<char> piece, bool) {
    if (piece.size() < (size_t{24} << 10) || random_() % 12 != 0) return TcpProxy::Go::kOn;
    piece[piece.size() / 4 + random_() % (piece.size() / 2)] ^= 0x10;  // its ends may be of other messages
    ++faults_;
    return TcpProxy::Go::kOn;
  });
  EXPECT_GE(faults_, 5);
}

TEST_F(Network, BlobsAreSpoiltOnTheServersDisk) {
  start_worker("a");
  const RemoteJob job = submit(0);
  EXPECT_EQ(watch(job.id).state, "done");
  // Of the asset's chunks, two.
  FarmClient client(address_);
  ASSERT_TRUE(fetch(job.id).ok());
  std::vector<std::filesystem::path> files;
  for (const auto& file :
       std::filesystem::recursive_directory_iterator(folder_.path() / ("fetched" + std::to_string(job.id)))) {
    if (file.is_regular_file() && file.path().filename() != "manifest") files.push_back(file.path());
  }
  std::sort(files.begin(), files.end());
  ASSERT_GE(files.size(), 4u);
  for (const size_t which : {size_t{1}, files.size() / 2}) {
    const std::string hex = sha256(value_or_die(read_file(files[which]))).hex();
    const std::filesystem::path blob = folder_.path() / "state" / "blobs" / hex.substr(0, 2) / hex.substr(2);
    std::fstream at(blob, std::ios::in | std::ios::out | std::ios::binary);
    ASSERT_TRUE(at.is_open()) << blob;
    at.seekg(40);
    const char byte = static_cast<char>(at.get() ^ 1);
    at.seekp(40);
    at.put(byte);
    ++faults_;
  }
  // Whoever fetches hears it, once for each; what is damaged is not handed out.
  std::filesystem::remove_all(folder_.path() / ("fetched" + std::to_string(job.id)));
  absl::Status fetched = fetch(job.id);
  ASSERT_FALSE(fetched.ok());
  EXPECT_THAT(std::string(fetched.message()), testing::HasSubstr("damaged"));
  // The same level once more: what is there still is used again, the rest is baked.
  for (uint64_t again = job.id, tries = 0; tries < 3; ++tries) {
    again = submit(0).id;
    const RemoteJob ended = watch(again);
    ASSERT_EQ(ended.state, "done");
    EXPECT_LT(ended.reused, ended.tasks);
    EXPECT_GT(ended.reused + 4, ended.tasks);
    fetched = fetch(again);
    if (!fetched.ok()) continue;  // the second one shows only now
    expect_whole(again, 0);
    return;
  }
  FAIL() << fetched;
}

/// Two hosts, as network namespaces: one has the server and a worker, one another worker.
class Partition : public BrokenFarm {
 protected:
  void SetUp() override {
    BrokenFarm::SetUp();
    made_ = ::geteuid() == 0 && ip("netns add " + space_);
    if (!made_ || !ip("link add " + here_ + " type veth peer name " + there_) ||
        !ip("link set " + there_ + " netns " + space_) || !ip("addr add " + net_ + "1/30 dev " + here_) ||
        !ip("link set " + here_ + " up") || !ip("-n " + space_ + " addr add " + net_ + "2/30 dev " + there_) ||
        !ip("netns exec " + space_ + " true")) {
      GTEST_SKIP() << "hosts can be parted by root only, where /usr/sbin/ip may make network namespaces";
    }
    connect(true);
    start_server(net_ + "1");
    start_worker("near");
    start_worker("far", {"/usr/sbin/ip", "netns", "exec", space_});
  }
  void TearDown() override {
    if (!made_) return;
    workers_.clear();
    ip("link del " + here_);
    ip("netns del " + space_);
    BrokenFarm::TearDown();
  }
  void connect(bool up) { EXPECT_TRUE(ip("-n " + space_ + " link set " + there_ + (up ? " up" : " down"))); }

 private:
  static bool ip(const std::string& what) {
    return std::system(("/usr/sbin/ip " + what + " 2>/dev/null").c_str()) == 0;
  }

  const std::string id_ = std::to_string(::getpid()), space_ = "lightloom" + id_, here_ = "ll" + id_ + "a",
                    there_ = "ll" + id_ + "b";
  const std::string net_ = "10.213." + std::to_string(::getpid() % 256) + ".";
  bool made_ = false;
};

TEST_F(Partition, HostsPartAndMeetAgain) {
  bool parted = false;
  const RemoteJob job = submit(0);
  EXPECT_EQ(watch(job.id,
                  [&](const RemoteJob&) {
                    if (parted || !busy().contains("far")) return;
                    connect(false);
                    parted = true;
                    ++faults_;
                  })
                .state,
            "done");
  ASSERT_TRUE(parted);
  EXPECT_TRUE(any_event(job.id, "expired", "far"));
  expect_whole(job.id, 0);
  // It comes back by itself, and works alone.
  connect(true);
  workers_.at("near")->stop(SIGKILL);
  const RemoteJob next = submit(1);
  EXPECT_EQ(watch(next.id).state, "done");
  EXPECT_TRUE(any_event(next.id, "completed", "far"));
  expect_whole(next.id, 1);
}

}  // namespace
}  // namespace lightloom::test
