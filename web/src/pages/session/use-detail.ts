import { useMemo } from "preact/hooks";
import { api } from "../../api/client";
import type { Session } from "../../api/types";
import { TraceBuffer } from "../../live/buffer";
import type { ProfileOrRecorded } from "./profile-choice";
import { detailWindow, isCovered, longestDetail, type Range } from "./detail-window";

interface Options {
  /** The id of the session. */
  session: string;
  profile: ProfileOrRecorded;
  /** Most moments of a trace. */
  points: number;
  /** Judged moments per second. */
  rate: number;
  /** Times of the recording that is played, s. */
  first: number;
  last: number;
}

/** A part of the recording in which every judged moment is drawn. */
interface Detail {
  range: Range;
  buffer: TraceBuffer;
}

/**
 * Fetches the shown part of a long recording again, with all of its judged moments: the trace of
 * the whole has every n-th of them only. Nothing is fetched for a part that is too long to be shown in full.
 */
export class DetailLoader {
  private detail?: Detail;
  private isLoading = false;
  /** Time before which nothing is fetched after a failure, ms. */
  private notBefore = 0;

  constructor(private readonly options: Options) {}

  /** Returns the buffer with every judged moment of `range`, if it is there, and fetches it otherwise. */
  at(range: Range): TraceBuffer | undefined {
    const { first, last, points, rate } = this.options;
    const longest = longestDetail(rate, points);
    if (range[1] - range[0] > longest) return undefined;
    const wanted = detailWindow(range, longest, [first, last]);
    const isAhead = this.detail && isCovered(range, this.detail.range, [first, last]);
    if (!isAhead && !this.isLoading && performance.now() > this.notBefore) void this.load(wanted);
    const { detail } = this;
    const isThere = detail && detail.range[0] <= range[0] && detail.range[1] >= Math.min(range[1], last);
    return isThere ? detail.buffer : undefined;
  }

  private async load(range: Range): Promise<void> {
    const { session, profile, points } = this.options;
    this.isLoading = true;
    try {
      const query = { from_s: range[0], to_s: range[1], points, profile: profile || undefined };
      this.detail = { range, buffer: TraceBuffer.of(await api.trace(session, query)) };
    } catch {
      // The thinned trace stays; the page says so.
      this.notBefore = performance.now() + RETRY_MS;
    }
    this.isLoading = false;
  }
}

/** Delay before a part that could not be fetched is fetched again, ms. */
const RETRY_MS = 3000;

/** The loader of details of a session; undefined while every judged moment is drawn anyway. */
export function useDetail(
  session: Session,
  profile: ProfileOrRecorded,
  buffer: TraceBuffer | undefined,
  /** Every how many judged moments `buffer` has one. */
  stride: number,
  points: number,
): DetailLoader | undefined {
  const { id } = session;
  return useMemo(() => {
    if (!buffer?.t.length || stride < 2) return undefined;
    const { first, last } = buffer;
    // The number of judged moments per second, by the trace of the whole.
    const rate = ((buffer.t.length - 1) * stride) / (last - first);
    return new DetailLoader({ session: id, profile, points, rate, first, last });
  }, [id, profile, buffer, stride, points]);
}
