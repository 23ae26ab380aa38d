#include "mqtt.h"

#include <cstdio>
#include <cstring>

namespace offbd {

namespace {

// Returns the beginning of the value of `name`, whose document is compact JSON; `end` if there is
// none. The payload is not ended by a zero.
const char *value_of(const char *payload, const char *end, const char *name) {
  char key[24];
  const size_t n = static_cast<size_t>(snprintf(key, sizeof key, "\"%s\":", name));
  for (const char *at = payload; at + n < end; at++) {
    if (memcmp(at, key, n) == 0) return at + n;
  }
  return end;
}

}  // namespace

MqttTransport::MqttTransport(Publisher &publisher, const char *asset) : publisher_(publisher) {
  snprintf(topic_, sizeof topic_, "offbd/v1/%s/telemetry", asset);
  snprintf(ack_topic_, sizeof ack_topic_, "offbd/v1/%s/ack", asset);
}

Outcome MqttTransport::send(const char *body, size_t length) {
  return publisher_.publish(topic_, body, length) ? Outcome::Waiting : Outcome::Failed;
}

void MqttTransport::acknowledged(Uplink &uplink, const char *payload, size_t length) {
  const char *end = payload + length;
  const char *session = value_of(payload, end, "session");
  const char *last_seq = value_of(payload, end, "last_seq");
  if (session == end || *session != '"' || last_seq == end) return;
  char name[Uplink::NAME_BYTES];
  size_t n = 0;
  for (session++; session < end && *session != '"'; session++) {
    if (n == sizeof name - 1) return;
    name[n++] = *session;
  }
  name[n] = '\0';
  uint32_t seq = 0;
  if (*last_seq < '0' || *last_seq > '9') return;
  for (; last_seq < end && *last_seq >= '0' && *last_seq <= '9'; last_seq++) {
    seq = seq * 10 + static_cast<uint32_t>(*last_seq - '0');
  }
  uplink.acknowledge(name, seq);
}

}  // namespace offbd
