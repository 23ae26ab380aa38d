// Tests of the core that need no service: prints what fails; the exit status is the number of
// failures.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "../src/Offbd.h"

namespace {

int failures = 0;

void check(bool holds, const char *what, int line) {
  if (holds) return;
  fprintf(stderr, "line %d: %s\n", line, what);
  failures++;
}
#define CHECK(condition) check(condition, #condition, __LINE__)

// A broker that keeps what is published, and loses it on request.
struct Broker : offbd::Publisher {
  std::vector<std::string> published;
  std::string topic;
  bool is_up = true;
  bool publish(const char *to, const char *payload, size_t length) override {
    if (!is_up) return false;
    topic = to;
    published.emplace_back(payload, length);
    return true;
  }
};

// An answer of the service, piece by piece.
struct Line : offbd::Connection {
  std::string sent, answer;
  size_t at = 0;
  bool is_up = true;
  bool open(const char *, uint16_t) override {
    at = 0;
    sent.clear();
    return is_up;
  }
  bool write(const char *data, size_t length) override {
    sent.append(data, length);
    return true;
  }
  size_t read(char *to, size_t room) override {
    const size_t n = std::min({room, answer.size() - at, size_t{7}});
    memcpy(to, answer.data() + at, n);
    at += n;
    return n;
  }
  void close() override {}
};

// A refusal of the service.
std::string problem(const char *status, const char *slug) {
  return std::string("HTTP/1.1 ") + status + "\r\n\r\n{\"type\":\"urn:offbd:problem:" + slug + "\"}";
}

offbd::Sample at(int64_t t_us) { return {t_us, 0.5F, -0.25F, NAN, 0.125F}; }

using Memory = offbd::RingMemory<8>;

void a_full_ring_keeps_the_oldest_and_counts_the_lost() {
  Memory memory{};
  offbd::Ring ring(memory, 1);
  for (int i = 0; i < 10; i++) ring.push(at(i));
  CHECK(ring.size() == 8 && ring.dropped() == 2);
  CHECK(ring.at(0).seq == 1 && ring.at(7).seq == 8);
  ring.take(3);
  ring.push(at(10));
  CHECK(ring.at(0).seq == 4 && ring.at(5).seq == 11);
}

void samples_survive_a_restart_and_garbage_does_not() {
  Memory memory;
  memset(static_cast<void *>(&memory), 0xa5, sizeof memory);
  {
    offbd::Ring ring(memory, 7);
    CHECK(ring.size() == 0 && ring.boot() == 1 && ring.id() == 7);
    ring.push(at(1));
    ring.push(at(2));
  }
  offbd::Ring ring(memory, 8);
  CHECK(ring.size() == 2 && ring.boot() == 2 && ring.id() == 7);
  ring.push(at(3));
  CHECK(ring.at(2).seq == 1 && ring.at(2).boot == 2);
  // A counter beyond the capacity is garbage.
  memory.pushed.store(memory.taken.load() + 9);
  CHECK(offbd::Ring(memory, 9).size() == 0);
}

void a_batch_has_samples_of_one_start_and_is_sent_until_it_is_acknowledged() {
  Memory memory{};
  { offbd::Ring(memory, 1).push(at(1)); }
  offbd::Ring ring(memory, 1);
  ring.push(at(20000));
  ring.push(at(30000));
  Broker broker;
  offbd::MqttTransport transport(broker, "rig");
  char body[1024];
  offbd::Uplink uplink(ring, transport, body, sizeof body);
  uplink.poll(0);
  uplink.poll(offbd::Uplink::HOLD_MS - 1);
  // The older session has ended, so its batch is full.
  CHECK(broker.published.size() == 1 && broker.topic == "offbd/v1/rig/telemetry");
  CHECK(broker.published[0] ==
        "{\"session\":\"board-00000001-1\",\"samples\":[{\"seq\":1,\"t_s\":0.000001,"
        "\"cmd_qx_rad\":0.5,\"cmd_qy_rad\":-0.25,\"x_m\":null,\"y_m\":0.125}]}");
  uplink.poll(offbd::Uplink::ACK_TIMEOUT_MS - 1);
  CHECK(broker.published.size() == 1);
  uplink.poll(offbd::Uplink::ACK_TIMEOUT_MS);
  CHECK(broker.published.size() == 2 && broker.published[1] == broker.published[0]);
  CHECK(uplink.resent() == 1);
  const auto acknowledge = [&](const char *text) {
    offbd::MqttTransport::acknowledged(uplink, text, strlen(text));
  };
  acknowledge("{\"session\":\"board-00000001-2\",\"last_seq\":1}");
  acknowledge("{\"session\":\"board-00000001-1\",\"last_seq\":null}");
  acknowledge("{\"session\":\"board-00000001-1\"");
  acknowledge("");
  CHECK(ring.size() == 3);
  acknowledge("{\"session\":\"board-00000001-1\",\"rejected\":[],\"last_seq\":1}");
  CHECK(ring.size() == 2);
  uplink.poll(3000, true);
  CHECK(broker.published.size() == 3);
  // The second acknowledgement of the first batch, and one of half of the second batch.
  acknowledge("{\"session\":\"board-00000001-1\",\"last_seq\":1}");
  CHECK(ring.size() == 2);
  acknowledge("{\"session\":\"board-00000001-2\",\"last_seq\":1}");
  CHECK(ring.size() == 1 && ring.at(0).seq == 2);
}

void delays_grow_and_are_bounded() {
  Memory memory{};
  offbd::Ring ring(memory, 1);
  ring.push(at(1));
  Broker broker;
  broker.is_up = false;
  offbd::MqttTransport transport(broker, "rig");
  char body[1024];
  offbd::Uplink uplink(ring, transport, body, sizeof body);
  uint32_t now_ms = 0xffffff00;  // the clock wraps around meanwhile
  uint32_t attempts = 0;
  uplink.poll(now_ms, true);
  for (uint32_t i = 0; i < 60000; i++, now_ms++) {
    const uint32_t before = uplink.resent();
    uplink.poll(now_ms, true);
    attempts += uplink.resent() - before;
  }
  // After 0.2, 0.4, 0.8, 1.6, 3.2, 6.4, 10, 10, 10, 10 s.
  CHECK(attempts == 10);
  broker.is_up = true;
  uplink.reconnected();
  uplink.poll(now_ms, true);
  CHECK(broker.published.size() == 1);
}

void an_answer_decides_over_the_batch() {
  const auto sent = [](const std::string &answer, uint32_t *refused = nullptr) {
    Memory memory{};
    offbd::Ring ring(memory, 1);
    ring.push(at(1));
    Line line;
    line.answer = answer;
    offbd::HttpTransport transport(line, "10.0.0.1", 8087, "rig", "secret");
    char body[1024];
    offbd::Uplink uplink(ring, transport, body, sizeof body);
    uplink.poll(0, true);
    CHECK(line.sent.find("POST /api/v1/assets/rig/telemetry HTTP/1.1\r\n") == 0);
    CHECK(line.sent.find("Authorization: Bearer secret\r\n") != std::string::npos);
    if (refused != nullptr) *refused = uplink.refused() + transport.rejecting();
    return ring.size() == 0;
  };
  uint32_t refused = 0;
  CHECK(sent("HTTP/1.1 200 OK\r\n\r\n{\"accepted\":1,\"rejected\":[]}", &refused) && refused == 0);
  CHECK(sent("HTTP/1.1 200 OK\r\n\r\n{\"accepted\":0,\"rejected\":[{\"index\":0}]}", &refused) && refused == 1);
  CHECK(sent(problem("422 Unprocessable", "invalid"), &refused) && refused == 1);
  // What is not of the service says nothing about the samples.
  for (const char *foreign : {"HTTP/1.1 200 OK\r\n\r\n<html>Log in</html>", "HTTP/1.1 200 OK\r\n\r\n",
                              "HTTP/1.1 204 No Content\r\n\r\n", "HTTP/1.1 413 Large\r\n\r\n<html>",
                              "HTTP/1.1 201 Created\r\n\r\n{\"accepted\":1}"}) {
    CHECK(!sent(foreign, &refused) && refused == 0);
  }
  CHECK(!sent(problem("401 Unauthorized", "unauthenticated"), &refused) && refused == 0);
  for (const char *later : {"HTTP/1.1 429 Too Many\r\n\r\n", "HTTP/1.1 503 No\r\n\r\n",
                            "HTTP/1.1 401 Who\r\n\r\n", "HTTP/1.1 404 What\r\n\r\n",
                            "HTTP/1.1 200 OK\r\ncontent-le", "", "SSH-2.0\r\n\r\n"}) {
    CHECK(!sent(later, &refused) && refused == 0);
  }
}

void samples_of_an_ended_session_go_to_another_one() {
  Memory memory{};
  { offbd::Ring(memory, 1).push(at(1)); }
  offbd::Ring ring(memory, 1);
  ring.push(at(20000));
  Line line;
  offbd::HttpTransport transport(line, "10.0.0.1", 8087, "rig");
  char body[1024];
  offbd::Uplink uplink(ring, transport, body, sizeof body);
  const auto session = [&](const char *name) {
    return line.sent.find(std::string("{\"session\":\"") + name + "\"") != std::string::npos;
  };
  line.answer = problem("409 Conflict", "session-ended");
  uint32_t now_ms = 0;
  uplink.poll(now_ms, true);
  CHECK(session("board-00000001-1"));
  uplink.poll(now_ms += 200, true);
  CHECK(session("board-00000001-1-2"));
  line.answer = "HTTP/1.1 200 OK\r\n\r\n{\"accepted\":1,\"rejected\":[]}";
  uplink.poll(now_ms += 400, true);
  CHECK(session("board-00000001-1-3") && ring.size() == 1);
  uplink.poll(now_ms, true);
  CHECK(session("board-00000001-2") && ring.size() == 0 && uplink.refused() == 0);
}

void numbers_that_the_service_would_refuse_are_missing() {
  Memory memory{};
  offbd::Ring ring(memory, 1);
  ring.push({1, INFINITY, -7.0F, 51.0F, -50.0F});
  const offbd::Sample &kept = ring.at(0).sample;
  CHECK(std::isnan(kept.qx_rad) && std::isnan(kept.qy_rad) && std::isnan(kept.x_m));
  CHECK(kept.y_m == -50.0F);
}

void the_longest_row_fits() {
  Memory memory{};
  offbd::Ring ring(memory, 0xffffffff);
  const float longest = -1.17549435e-38F;
  ring.push({INT64_MIN, longest, longest, longest, longest});
  Broker broker;
  offbd::MqttTransport transport(broker, "rig");
  char body[offbd::Uplink::FRAME_BYTES + offbd::Uplink::ROW_BYTES];
  offbd::Uplink uplink(ring, transport, body, sizeof body);
  uplink.poll(0, true);
  CHECK(broker.published.size() == 1 && broker.published[0].size() < sizeof body);
}

}  // namespace

int main() {
  a_full_ring_keeps_the_oldest_and_counts_the_lost();
  samples_survive_a_restart_and_garbage_does_not();
  a_batch_has_samples_of_one_start_and_is_sent_until_it_is_acknowledged();
  delays_grow_and_are_bounded();
  an_answer_decides_over_the_batch();
  samples_of_an_ended_session_go_to_another_one();
  numbers_that_the_service_would_refuse_are_missing();
  the_longest_row_fits();
  return failures;
}
