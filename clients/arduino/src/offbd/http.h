// The service's HTTP interface as a transport.
#pragma once

#include "uplink.h"

namespace offbd {

// A TCP connection. A call may wait for as long as its own timeout, a few seconds.
class Connection {
 public:
  virtual ~Connection() = default;
  virtual bool open(const char *host, uint16_t port) = 0;
  // Writes all bytes; returns whether it could.
  virtual bool write(const char *data, size_t length) = 0;
  // Reads at least one byte; returns 0 at the end, after an error, or after the timeout.
  virtual size_t read(char *to, size_t room) = 0;
  virtual void close() = 0;
};

class HttpTransport : public Transport {
 public:
  // `token` is the device's token, or null if the service requires none. The strings must live
  // as long as the transport.
  HttpTransport(Connection &connection, const char *host, uint16_t port, const char *asset,
                const char *token = nullptr)
      : connection_(connection), host_(host), port_(port), asset_(asset), token_(token) {}

  Outcome send(const char *body, size_t length) override;

  // Status of the last answer; 0 without one.
  int status() const { return status_; }
  // Answers that name rejected rows: their numbers are invalid or absurd.
  uint32_t rejecting() const { return rejecting_; }

 private:
  bool post(const char *body, size_t length);
  // Reads the answer; sets `status_` and returns whether its whole head has come.
  bool receive();

  static constexpr size_t HEAD_BYTES = 512;
  // Of an answer only the beginning is kept, in which the counts are.
  static constexpr size_t ANSWER_BYTES = 1024;

  Connection &connection_;
  const char *const host_;
  const uint16_t port_;
  const char *const asset_;
  const char *const token_;
  char answer_[ANSWER_BYTES];
  int status_ = 0;
  uint32_t rejecting_ = 0;
};

}  // namespace offbd
