import { createContext } from "preact";
import { useContext } from "preact/hooks";
import type { Caller } from "../../api/types";

export const CallerContext = createContext<Caller | undefined>(undefined);

/** The user of the page and their rights; without authentication, everyone has all rights. */
export const useCaller = () => useContext(CallerContext);
