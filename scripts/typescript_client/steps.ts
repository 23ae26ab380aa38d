/** Calls a service with the generated client. $SERVICE is its address, $CLIENT_TOKEN a token of an admin. */
import {
  type AlarmChange,
  AssetsApi,
  Configuration,
  NotificationsApi,
  type Problem,
  ResponseError,
  type Rule,
  TelemetryApi,
} from "./client";

declare const process: { env: Record<string, string>; exitCode: number };

const check = (holds: boolean, what: string): void => {
  if (!holds) throw new Error(what);
};

/** Returns the problem with which the service answers a call that must fail. */
const problemOf = async (call: Promise<unknown>): Promise<Problem> => {
  try {
    await call;
  } catch (error) {
    if (error instanceof ResponseError) return (await error.response.json()) as Problem;
    throw error;
  }
  throw new Error("the call succeeded");
};

const main = async (): Promise<void> => {
  const { SERVICE: basePath, CLIENT_TOKEN: accessToken } = process.env;
  const configuration = new Configuration({ basePath, accessToken });
  const assets = new AssetsApi(configuration);

  const made = await assets.createAssetRaw({ asset: { name: "rig", sampleRateHz: 100 } });
  check(made.raw.headers.get("location") === "/api/v1/assets/rig", "no location");
  check((await made.value()).plate?.lengthM === 0.38, "the defaults are not filled in");
  const twice = await problemOf(assets.createAsset({ asset: { name: "rig" } }));
  check(twice.status === 409 && twice.type === "urn:offbd:problem:asset-exists", JSON.stringify(twice));

  const samples = [0, 0.01].map((tS) => ({ tS, xM: 0.01, yM: 0, cmdQxRad: 0, cmdQyRad: 0 }));
  const telemetry = new TelemetryApi(configuration);
  const ack = await telemetry.postTelemetry({ asset: "rig", rows: { session: "monday", samples } });
  check(ack.accepted === 2, JSON.stringify(ack));
  check((await assets.getFleet({})).items[0]?.session === "monday", "the fleet has no session");

  const notifications = new NotificationsApi(configuration);
  const webhook = { url: "http://127.0.0.1:9/" };
  const channel = await notifications.createChannel({ newChannel: { name: "hook", webhook } });
  const changes: AlarmChange[] = ["confirmed"];
  const newRule = { name: "all", channel: channel.id, changes };
  const rule: Rule = await notifications.createRule({ newRule });
  check(rule.channelName === "hook" && rule.asset === "*", JSON.stringify(rule));
  const changed = await notifications.putRuleRaw({ rule: rule.id, ifMatch: rule.etag, newRule });
  const now = await changed.value();
  check(changed.raw.headers.get("etag") === now.etag, "the tag is not that of the header");
  const stale = notifications.deleteRule({ rule: rule.id, ifMatch: '"stale"' });
  check((await problemOf(stale)).etag === now.etag, "a stale edition was deleted");
};

main().catch((error: unknown) => {
  console.error(error);
  process.exitCode = 1;
});
