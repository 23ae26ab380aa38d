// The connections of an Arduino board for the transports of this library.
#pragma once

#include <Client.h>

#include "http.h"

namespace offbd {

// A WiFiClient, EthernetClient or another Client of the board; WiFiClientSecure encrypts.
class BoardConnection : public Connection {
 public:
  // Longest wait for the service, ms.
  static constexpr uint32_t TIMEOUT_MS = 10000;

  explicit BoardConnection(Client &client) : client_(client) {}

  bool open(const char *host, uint16_t port) override { return client_.connect(host, port) == 1; }

  bool write(const char *data, size_t length) override {
    return client_.write(reinterpret_cast<const uint8_t *>(data), length) == length;
  }

  size_t read(char *to, size_t room) override {
    const uint32_t since_ms = millis();
    while (client_.available() == 0) {
      if (!client_.connected() || millis() - since_ms >= TIMEOUT_MS) return 0;
      delay(1);
    }
    const int n = client_.read(reinterpret_cast<uint8_t *>(to), room);
    return n > 0 ? static_cast<size_t>(n) : 0;
  }

  void close() override { client_.stop(); }

 private:
  Client &client_;
};

}  // namespace offbd
