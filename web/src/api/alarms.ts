/** The requests about alarms, mutes and notifications. */
import type { components } from "../../generated/schema";
import { actor } from "./access";
import { get, getAll, query, segment, send } from "./request";
import type { Page } from "./types";

type Schemas = components["schemas"];
export type Advice = Schemas["AdviceList"];
export type Alarm = Schemas["Alarm"];
export type AlarmChange = Schemas["AlarmChange"];
export type AlarmCode = Schemas["AlarmCode"];
export type Channel = Schemas["Channel"];
export type Delivery = Schemas["Delivery"];
export type DeliveryState = Schemas["DeliveryState"];
export type Mute = Schemas["Mute"];
export type Note = Schemas["Note"];
export type NewChannel = Schemas["NewChannel"];
export type NewRule = Schemas["NewRule"];
export type Rule = Schemas["Rule"];

export interface AlarmFilter {
  state?: string;
  asset?: string;
  tag?: string;
  code?: string;
  acknowledged?: boolean;
  from?: string;
}

const CHANNELS = "/notifications/channels";
const RULES = "/notifications/rules";
const by = () => query({ by: actor() });

export const alarmApi = {
  alarms: (filter: AlarmFilter, cursor?: string | null) =>
    get<Page<Alarm>>(`/alarms${query({ ...filter, cursor, limit: 100 })}`),
  allAlarms: (filter: AlarmFilter) => getAll<Alarm>("/alarms", { ...filter }),
  acknowledge: (alarms: { asset: string; code: AlarmCode }[]) =>
    send<Schemas["Acknowledged"]>("POST", `/alarms/acknowledge${by()}`, { alarms }),
  advice: () => get<Advice>("/advice"),
  putNote: (code: AlarmCode, text: string, before?: Note) =>
    send("PUT", `/advice/${segment(code)}/note${by()}`, { text }, before?.etag ?? null),
  mutes: async (asset: string) => (await get<Page<Mute>>(`/assets/${segment(asset)}/mutes`)).items,
  mute: (asset: string, code: AlarmCode, reason: string, until: string) =>
    send<Mute>("PUT", `/assets/${segment(asset)}/mutes/${segment(code)}${by()}`, { reason, until }, null),
  unmute: ({ asset, code, etag }: Mute) =>
    send("DELETE", `/assets/${segment(asset)}/mutes/${segment(code)}`, undefined, etag),
  channels: async () => (await get<Page<Channel>>(CHANNELS)).items,
  createChannel: (channel: NewChannel) => send<Schemas["MadeChannel"]>("POST", CHANNELS, channel),
  putChannel: ({ id, etag }: Channel, channel: NewChannel) =>
    send<Schemas["MadeChannel"]>("PUT", `${CHANNELS}/${segment(id)}`, channel, etag),
  deleteChannel: ({ id, etag }: Channel) => send("DELETE", `${CHANNELS}/${segment(id)}`, undefined, etag),
  testChannel: (id: string) => send<Delivery>("POST", `${CHANNELS}/${segment(id)}/test`),
  rules: async () => (await get<Page<Rule>>(RULES)).items,
  createRule: (rule: NewRule) => send<Rule>("POST", RULES, rule),
  putRule: ({ id, etag }: Rule, rule: NewRule) => send<Rule>("PUT", `${RULES}/${segment(id)}`, rule, etag),
  deleteRule: ({ id, etag }: Rule) => send("DELETE", `${RULES}/${segment(id)}`, undefined, etag),
  deliveries: (state?: DeliveryState) =>
    get<Page<Delivery>>(`/notifications/deliveries${query({ state, limit: 100 })}`),
};
