#pragma once

#include "Client.h"

enum WifiStatus { WL_CONNECTED };
enum WifiMode { WIFI_STA };

struct WifiDevice {
  void mode(WifiMode mode);
  void setAutoReconnect(bool on);
  void begin(const char *name, const char *password);
  WifiStatus status();
};
extern WifiDevice WiFi;

class WiFiClient : public Client {
 public:
  int connect(const char *host, uint16_t port) override;
  size_t write(const uint8_t *data, size_t length) override;
  int available() override;
  int read(uint8_t *to, size_t room) override;
  uint8_t connected() override;
  void stop() override;
};
