/** The requests of administrators: tokens and the audit log. */
import type { components } from "../../generated/schema";
import { get, getAll, query, segment, send } from "./request";
import type { NewToken, Page } from "./types";

type Schemas = components["schemas"];
export type AuditEntry = Schemas["Audit"];
export type Role = Schemas["Role"];
export type Token = Schemas["Token"];
export type TokenRequest = Schemas["NewToken"];

export const administration = {
  tokens: () => getAll<Token>("/tokens", {}),
  createToken: (token: TokenRequest) => send<NewToken>("POST", "/tokens", token),
  revokeToken: (id: string) => send<void>("DELETE", `/tokens/${segment(id)}`),
  audit: (cursor?: string | null) => get<Page<AuditEntry>>(`/audit${query({ cursor, limit: 50 })}`),
};
