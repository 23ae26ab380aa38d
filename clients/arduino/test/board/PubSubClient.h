#pragma once

#include "Client.h"

class PubSubClient {
 public:
  explicit PubSubClient(Client &client);
  void setServer(const char *host, uint16_t port);
  bool setBufferSize(uint16_t bytes);
  void setCallback(void (*received)(char *topic, uint8_t *payload, unsigned int length));
  bool connect(const char *id);
  bool subscribe(const char *topic);
  bool publish(const char *topic, const uint8_t *payload, unsigned int length, bool retained);
  bool loop();
};
