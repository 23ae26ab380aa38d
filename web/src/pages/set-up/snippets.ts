/** Code snippets that send samples to the service. */

export interface Snippet {
  language: string;
  text: string;
}

/** Returns the snippets for `asset`, with `token` if the service requires one. */
export function snippets(asset: string, origin: string, token?: string): Snippet[] {
  const urlFrom = (origin: string) => `${origin}/api/v1/assets/${encodeURIComponent(asset)}/telemetry`;
  // A microcontroller is a separate machine and cannot reach the service at localhost.
  const remote = origin.replace(/\/\/(localhost|127\.0\.0\.1)/, "//SERVER");
  return [
    { language: "curl", text: curl(urlFrom(origin), token) },
    { language: "Python", text: python(urlFrom(origin), token) },
    { language: "Arduino / ESP32", text: arduino(urlFrom(remote), token) },
  ];
}

function curl(url: string, token?: string): string {
  const header = token ? `-H 'authorization: Bearer ${token}' ` : "";
  return `# One sample: time on the device's clock in s, commanded angles in rad, ball position in m.
curl ${header}--json '{"samples":[{"seq":1,"t_s":0.00,"cmd_qx_rad":0.0,"cmd_qy_rad":0.02,"x_m":0.010,"y_m":-0.004}]}' \\
  ${url}

# A whole recording with the header t_s,cmd_qx_rad,cmd_qy_rad,x_m,y_m
curl ${header}-H 'content-type: text/csv' --data-binary @recording.csv ${url}
`;
}

function python(url: string, token?: string): string {
  const header = token ? `, "authorization": "Bearer ${token}"` : "";
  return `import json, time, urllib.request

URL = "${url}"

def read_rig():
    """Replace this: commanded plate angles in rad, ball position in m (None if not seen)."""
    return 0.0, 0.0, 0.0, 0.0          # qx, qy, x, y

def send(samples):
    request = urllib.request.Request(
        URL, json.dumps({"samples": samples}).encode(), {"content-type": "application/json"${header}})
    with urllib.request.urlopen(request, timeout=5) as answer:
        return json.load(answer)       # {"accepted": 10, "rejected": [], ...}: stored

seq, batch, start = 0, [], time.monotonic()
while True:
    qx, qy, x, y = read_rig()
    seq += 1
    batch.append({"seq": seq, "t_s": time.monotonic() - start,
                  "cmd_qx_rad": qx, "cmd_qy_rad": qy, "x_m": x, "y_m": y})
    if len(batch) >= 20:
        try:
            send(batch)
            batch = []
        except OSError as error:       # keep the batch and retry: duplicates count once
            print("not sent:", error)
            batch = batch[-6000:]
    time.sleep(0.01)
`;
}

function arduino(url: string, token?: string): string {
  const header = token ? `\n  http.addHeader("authorization", "Bearer ${token}");` : "";
  return `#include <WiFi.h>
#include <HTTPClient.h>

const char* URL = "${url}";
String batch;
uint32_t seq = 0, n = 0;

void sample(float qx, float qy, float x, float y) {   // rad and m; every 10 ms
  char row[120];
  snprintf(row, sizeof row,
    "%s{\\"seq\\":%u,\\"t_s\\":%.4f,\\"cmd_qx_rad\\":%.5f,\\"cmd_qy_rad\\":%.5f,\\"x_m\\":%.5f,\\"y_m\\":%.5f}",
    n ? "," : "", ++seq, millis() / 1000.0, qx, qy, x, y);
  batch += row;
  if (++n < 20) return;
  HTTPClient http;
  http.begin(URL);
  http.addHeader("content-type", "application/json");${header}
  int status = http.POST("{\\"samples\\":[" + batch + "]}");
  http.end();
  if (status == 200 || n > 200) { batch = ""; n = 0; }  // otherwise retried with the next batch
}

void setup() {
  WiFi.begin("NETWORK", "PASSWORD");
  while (WiFi.status() != WL_CONNECTED) delay(100);
}

void loop() {
  sample(/* qx */ 0, /* qy */ 0, /* x */ 0, /* y */ 0);   // your values
  delay(10);
}
`;
}
