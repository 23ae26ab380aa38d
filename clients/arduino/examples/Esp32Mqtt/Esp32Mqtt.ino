// Streams a ball-on-plate rig to offbd from an ESP32, through an MQTT broker to which the
// service is connected.
//
// Like Esp32Http, but the batches go to offbd/v1/ASSET/telemetry, and the service acknowledges
// them on offbd/v1/ASSET/ack once they are stored. Needs the library PubSubClient.

#include <Offbd.h>
#include <PubSubClient.h>
#include <WiFi.h>

static const char *WIFI_NAME = "your-network";
static const char *WIFI_PASSWORD = "your-password";
static const char *BROKER = "192.168.1.10";
static const char *ASSET = "my-rig";
static const int64_t PERIOD_US = 10000;  // 100 Hz

static offbd::RingMemory<2048> memory;  // 64 KiB: 20 s at 100 Hz
static offbd::Ring *ring;
static char body[offbd::Uplink::FRAME_BYTES + 20 * offbd::Uplink::ROW_BYTES];
static WiFiClient client;
static PubSubClient mqtt(client);

struct MqttPublisher : offbd::Publisher {
  bool publish(const char *topic, const char *payload, size_t length) override {
    return mqtt.publish(topic, reinterpret_cast<const uint8_t *>(payload), length, false);
  }
};

static void uplinkTask(void *) {
  static MqttPublisher publisher;
  static offbd::MqttTransport transport(publisher, ASSET);
  static offbd::Uplink uplink(*ring, transport, body, sizeof body);
  mqtt.setServer(BROKER, 1883);
  mqtt.setBufferSize(sizeof body + offbd::MqttTransport::TOPIC_BYTES);
  mqtt.setCallback([](char *, uint8_t *payload, unsigned int length) {
    offbd::MqttTransport::acknowledged(uplink, reinterpret_cast<const char *>(payload), length);
  });
  for (;;) {
    if (mqtt.loop()) {
      uplink.poll(millis());
    } else if (WiFi.status() == WL_CONNECTED && mqtt.connect(ASSET)) {
      mqtt.subscribe(transport.ack_topic());
      uplink.reconnected();
    }
    vTaskDelay(pdMS_TO_TICKS(20));
  }
}

void setup() {
  WiFi.mode(WIFI_STA);
  WiFi.setAutoReconnect(true);
  WiFi.begin(WIFI_NAME, WIFI_PASSWORD);
  static offbd::Ring kept(memory, esp_random());
  ring = &kept;
  xTaskCreatePinnedToCore(uplinkTask, "uplink", 8192, NULL, 1, NULL, 0);
}

void loop() {
  static int64_t due_us = esp_timer_get_time();
  while (esp_timer_get_time() < due_us) {
  }
  // The ball's position, the controller and the servos of your rig come here; see Esp32Http.
  ring->push({esp_timer_get_time(), 0.0f, 0.0f, NAN, NAN});
  due_us += PERIOD_US;
}
