// Streams a ball-on-plate rig to offbd from an ESP32, in JSON batches over HTTP.
//
// The control loop never waits for the network: it puts numbered samples into a
// queue, and a task on the other core posts them in batches. Each batch is retried
// until the service has stored it; a sample that arrives twice is stored once.
// While the network is down, the queue holds 20 s of samples at 100 Hz; further
// samples are lost and counted in `dropped`.
//
// Arduino IDE: board "ESP32 Dev Module", no libraries beyond the board's own.
// Fill in the five settings and the three functions of your rig.

#include <HTTPClient.h>
#include <WiFi.h>
#include <math.h>

// ---- settings ---------------------------------------------------------------
static const char *WIFI_NAME = "your-network";
static const char *WIFI_PASSWORD = "your-password";
static const char *SERVICE = "http://192.168.1.10:8087";
static const char *ASSET = "my-rig";
static const int64_t PERIOD_US = 10000;  // 100 Hz

// ---- your rig ---------------------------------------------------------------
// Reads the ball's position in metres; returns false if no ball is seen.
static bool readBall(float *x_m, float *y_m) {
  *x_m = 0.0f;
  *y_m = 0.0f;
  return true;
}

// Your controller: plate angles in radians. +qy moves the ball toward +x, +qx
// toward -y.
static void control(bool seen, float x_m, float y_m, float *qx_rad, float *qy_rad) {
  *qx_rad = seen ? 0.5f * y_m : 0.0f;
  *qy_rad = seen ? -0.5f * x_m : 0.0f;
}

// Moves the servos to these angles, radians.
static void drive(float qx_rad, float qy_rad) {
  (void)qx_rad;
  (void)qy_rad;
}

// ---- telemetry --------------------------------------------------------------
struct Row {
  uint32_t seq;
  int64_t at_us;
  float qx_rad, qy_rad, x_m, y_m;  // NaN: no ball seen
};

static const size_t QUEUE_ROWS = 2000;  // 28 bytes each
static const size_t BATCH_ROWS = 50;
static const size_t ROW_BYTES = 128;  // longest row as JSON is 110 bytes

static QueueHandle_t rows;
static volatile uint32_t dropped = 0;
static char session[32];
static char body[BATCH_ROWS * ROW_BYTES + 128];

static size_t writeNumber(char *to, size_t room, float value) {
  return !isfinite(value) ? snprintf(to, room, "null") : snprintf(to, room, "%.5f", value);
}

static size_t writeRow(char *to, size_t room, const Row &row) {
  char x[20], y[20];
  writeNumber(x, sizeof x, row.x_m);
  writeNumber(y, sizeof y, row.y_m);
  return snprintf(to, room,
                  "{\"seq\":%lu,\"t_s\":%.4f,\"cmd_qx_rad\":%.5f,\"cmd_qy_rad\":%.5f,"
                  "\"x_m\":%s,\"y_m\":%s}",
                  (unsigned long)row.seq, row.at_us / 1e6, row.qx_rad, row.qy_rad, x, y);
}

static size_t writeBatch(const Row *batch, size_t n) {
  size_t used = snprintf(body, sizeof body, "{\"session\":\"%s\",\"samples\":[", session);
  for (size_t i = 0; i < n; i++) {
    if (i > 0) body[used++] = ',';
    used += writeRow(body + used, sizeof body - used, batch[i]);
  }
  return used + snprintf(body + used, sizeof body - used, "]}");
}

// Posts `body` until the service acknowledges that it is stored. A batch that the
// service rejects for good (400 to 499, except 408 and 429) is given up.
static void deliver(size_t length) {
  char url[128];
  snprintf(url, sizeof url, "%s/api/v1/assets/%s/telemetry", SERVICE, ASSET);
  uint32_t delay_ms = 200;
  for (;;) {
    int code = -1;
    if (WiFi.status() == WL_CONNECTED) {
      HTTPClient http;
      http.setTimeout(10000);
      http.begin(url);
      http.addHeader("Content-Type", "application/json");
      code = http.POST((uint8_t *)body, length);
      http.end();
    }
    bool retry = code < 200 || code == 408 || code == 429 || code >= 500;
    if (!retry) {
      if (code >= 300) Serial.printf("batch rejected: %d\n", code);
      return;
    }
    vTaskDelay(pdMS_TO_TICKS(delay_ms));
    delay_ms = delay_ms < 10000 ? delay_ms * 2 : 10000;
  }
}

static void uplink(void *) {
  static Row batch[BATCH_ROWS];
  for (;;) {
    size_t n = 0;
    // A full batch, or fewer rows if none arrives for half a second.
    while (n < BATCH_ROWS && xQueueReceive(rows, &batch[n], pdMS_TO_TICKS(500)) == pdTRUE) n++;
    if (n > 0) deliver(writeBatch(batch, n));
  }
}

// ---- the device -------------------------------------------------------------
void setup() {
  Serial.begin(115200);
  WiFi.mode(WIFI_STA);
  WiFi.setAutoReconnect(true);
  WiFi.begin(WIFI_NAME, WIFI_PASSWORD);
  // The clock and the sequence numbers restart with every boot, hence the new session.
  snprintf(session, sizeof session, "boot-%08lx", (unsigned long)esp_random());
  rows = xQueueCreate(QUEUE_ROWS, sizeof(Row));
  xTaskCreatePinnedToCore(uplink, "uplink", 8192, NULL, 1, NULL, 0);
}

void loop() {
  static int64_t due_us = esp_timer_get_time();
  static uint32_t seq = 0;
  while (esp_timer_get_time() < due_us) {
  }
  Row row = {++seq, esp_timer_get_time(), 0.0f, 0.0f, NAN, NAN};
  float x_m = 0.0f, y_m = 0.0f;
  const bool seen = readBall(&x_m, &y_m);
  control(seen, x_m, y_m, &row.qx_rad, &row.qy_rad);
  drive(row.qx_rad, row.qy_rad);
  if (seen) {
    row.x_m = x_m;
    row.y_m = y_m;
  }
  if (xQueueSend(rows, &row, 0) != pdTRUE) dropped++;
  due_us += PERIOD_US;
}
