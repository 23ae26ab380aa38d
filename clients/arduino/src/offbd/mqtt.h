// Telemetry over MQTT: batches are published to offbd/v1/ASSET/telemetry, and the service
// publishes {"session":…,"last_seq":…} to offbd/v1/ASSET/ack once a batch is stored. Quality of
// service 0 is enough, because a batch without an acknowledgement is sent again.
#pragma once

#include "uplink.h"

namespace offbd {

// A client of a broker, such as PubSubClient.
class Publisher {
 public:
  virtual ~Publisher() = default;
  // Returns whether the message was handed over to the connection.
  virtual bool publish(const char *topic, const char *payload, size_t length) = 0;
};

class MqttTransport : public Transport {
 public:
  // Longest topic, bytes: an asset's name has up to 128.
  static constexpr size_t TOPIC_BYTES = 160;

  MqttTransport(Publisher &publisher, const char *asset);

  Outcome send(const char *body, size_t length) override;

  // The topic to subscribe to whenever the connection to the broker is up.
  const char *ack_topic() const { return ack_topic_; }

  // Takes a message of that topic.
  static void acknowledged(Uplink &uplink, const char *payload, size_t length);

 private:
  Publisher &publisher_;
  char topic_[TOPIC_BYTES];
  char ack_topic_[TOPIC_BYTES];
};

}  // namespace offbd
