/** The requests about the tags of rigs. */
import { get, getAll, segment, send } from "./request";
import type { components } from "../../generated/schema";
import type { TagUse } from "./types";

type Tags = components["schemas"]["Tags"];

export const tagApi = {
  /** The tags in use, in alphabetical order. */
  inUse: () => getAll<TagUse>("/tags", {}).then((uses) => uses.map(({ tag }) => tag)),
  of: (asset: string) => get<Tags>(`/assets/${segment(asset)}/tags`).then(({ tags }) => tags),
  put: (asset: string, tags: string[]) => send<Tags>("PUT", `/assets/${segment(asset)}/tags`, { tags }),
};
