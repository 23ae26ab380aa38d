// A board on the host: pushes samples and sends them over HTTP until all are stored, or until it
// is killed. Its memory is a file, which survives the kill as RTC memory survives a restart.
//
//     device MEMORY PUSHED HOST PORT ASSET SAMPLES
//
// PUSHED is a file of one 32-bit number per start of the board: the samples pushed in it.
#include <fcntl.h>
#include <netdb.h>
#include <poll.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <thread>

#include "../src/offbd/http.h"

namespace {

class PosixConnection : public offbd::Connection {
 public:
  bool open(const char *host, uint16_t port) override {
    addrinfo *found = nullptr;
    if (getaddrinfo(host, std::to_string(port).c_str(), nullptr, &found) != 0) return false;
    socket_ = socket(found->ai_family, SOCK_STREAM, 0);
    const bool connected = connect(socket_, found->ai_addr, found->ai_addrlen) == 0;
    freeaddrinfo(found);
    return connected;
  }

  bool write(const char *data, size_t length) override {
    while (length > 0) {
      const ssize_t n = ::send(socket_, data, length, MSG_NOSIGNAL);
      if (n <= 0) return false;
      data += n;
      length -= static_cast<size_t>(n);
    }
    return true;
  }

  size_t read(char *to, size_t room) override {
    pollfd waiting{socket_, POLLIN, 0};
    if (poll(&waiting, 1, 10000) <= 0) return 0;
    const ssize_t n = recv(socket_, to, room, 0);
    return n > 0 ? static_cast<size_t>(n) : 0;
  }

  void close() override {
    if (socket_ >= 0) ::close(socket_);
    socket_ = -1;
  }

 private:
  int socket_ = -1;
};

void *mapped(const char *path, size_t size) {
  const int file = ::open(path, O_RDWR | O_CREAT, 0600);
  if (file < 0 || ftruncate(file, static_cast<off_t>(size)) != 0) exit(2);
  void *at = mmap(nullptr, size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  if (at == MAP_FAILED) exit(2);
  return at;
}

uint32_t now_ms() {
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<uint32_t>(now.tv_sec * 1000 + now.tv_nsec / 1000000);
}

void rest() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

// A sample whose numbers say where it belongs; every 50th is without a ball.
offbd::Sample sample(uint32_t boot, uint32_t seq) {
  const float unit = 1.0F / 1048576.0F;
  const float x_m = seq % 50 == 0 ? NAN : static_cast<float>(seq % 100000) * unit;
  return offbd::Sample{static_cast<int64_t>(seq) * 10000, static_cast<float>(boot) * unit, 0.0F, x_m,
                       0.0F};
}

}  // namespace

int main(int count, char **words) {
  constexpr size_t CAPACITY = 512;
  if (count != 7) return 2;
  using Memory = offbd::RingMemory<CAPACITY>;
  auto *memory = static_cast<Memory *>(mapped(words[1], sizeof(Memory)));
  auto *pushed = static_cast<volatile uint32_t *>(mapped(words[2], 4096));
  const auto n = static_cast<uint32_t>(atol(words[6]));
  offbd::Ring ring(*memory, 0x1a2b3c4d);
  PosixConnection connection;
  offbd::HttpTransport transport(connection, words[3], static_cast<uint16_t>(atoi(words[4])), words[5]);
  static char body[offbd::Uplink::FRAME_BYTES + 40 * offbd::Uplink::ROW_BYTES];
  offbd::Uplink uplink(ring, transport, body, sizeof body);

  std::thread control([&] {
    for (uint32_t seq = 1; seq <= n; seq++) {
      // A real board drops a sample instead; here the line is too slow for the pace of a test.
      while (ring.size() >= CAPACITY) rest();
      ring.push(sample(ring.boot(), seq));
      pushed[ring.boot()] = seq;
    }
  });
  while (pushed[ring.boot()] < n || ring.size() > 0) {
    uplink.poll(now_ms(), pushed[ring.boot()] == n);
    rest();
  }
  control.join();
  printf("%u batches sent again, %u refused, %u samples dropped, %u answers with rejected rows\n",
         uplink.resent(), uplink.refused(), ring.dropped(), transport.rejecting());
  return uplink.refused() + ring.dropped() + transport.rejecting() == 0 ? 0 : 1;
}
