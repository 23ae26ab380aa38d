/** Recordings: the list, and the door by which others come in. */
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { api } from "../api/client";
import type { Session } from "../api/types";
import { useAsk, useTitle } from "../hooks";
import { Act, Empty, Loading, Trouble } from "../parts/bits";
import { at, go, Link, usePlace } from "../router";
import { clock, count, duration, verdict } from "../words";
import { ImportDialogue } from "./import-dialogue";

const PAGE = 100;

export function SessionsPage() {
  useTitle("Sessions");
  const { query } = usePlace();
  const asset = query.get("asset") ?? "";
  const first = useAsk(() => api.sessions({ asset, limit: PAGE }), `sessions ${asset}`, 5000);
  const assets = useAsk(() => api.fleet().then((fleet) => fleet.map((entry) => entry.asset)), "names");
  const [more, setMore] = useState<{ asset: string; items: Session[]; next?: string | null }>();
  const [file, setFile] = useState<File>();
  const rest = more?.asset === asset ? more : undefined;
  const known = new Set(first.data?.items.map((session) => session.id));
  const items = [
    ...(first.data?.items ?? []),
    ...(rest?.items ?? []).filter((session) => !known.has(session.id)),
  ];
  const next = rest ? rest.next : first.data?.next;
  const load = async () => {
    const page = await api.sessions({ asset, limit: PAGE, cursor: next });
    setMore({ asset, items: [...(rest?.items ?? []), ...page.items], next: page.next });
  };
  return (
    <main>
      <header class="page-head">
        <h1>Sessions</h1>
        <div class="page-tools">
          <label class="inline">
            Rig{" "}
            <select
              value={asset}
              onChange={(e) =>
                go(
                  e.currentTarget.value
                    ? `/sessions?asset=${encodeURIComponent(e.currentTarget.value)}`
                    : "/sessions",
                  true,
                )
              }
            >
              <option value="">all</option>
              {assets.data?.map((name) => (
                <option value={name}>{name}</option>
              ))}
            </select>
          </label>
        </div>
      </header>
      <DropZone take={setFile} />
      {file && (
        <ImportDialogue
          key={file.name + file.lastModified}
          file={file}
          assets={assets.data ?? []}
          asset={asset || undefined}
          close={() => setFile((now) => (now === file ? undefined : now))}
        />
      )}
      <Trouble error={first.error} again={() => void first.again()} />
      {!first.data && !first.error && <Loading what="the sessions" />}
      {first.data && items.length === 0 && (
        <Empty title="No session yet">
          <p>A session begins when a rig sends its first sample, or when a recording is imported.</p>
        </Empty>
      )}
      {items.length > 0 && (
        <div class="scroll">
          <table class="list">
            <thead>
              <tr>
                <th>Session</th>
                <th>Rig</th>
                <th>Began</th>
                <th class="n">Length</th>
                <th class="n">Samples</th>
                <th>Verdict</th>
              </tr>
            </thead>
            <tbody>
              {items.map((session) => (
                <Row key={session.id} session={session} />
              ))}
            </tbody>
          </table>
        </div>
      )}
      {next && (
        <p>
          <Act act={load}>Show more</Act>
        </p>
      )}
    </main>
  );
}

function Row({ session }: { session: Session }) {
  const came = session.verdict && verdict(session.verdict);
  const length =
    session.first_t_s != null && session.last_t_s != null ? session.last_t_s - session.first_t_s : null;
  return (
    <tr>
      <th scope="row">
        <Link to={at("sessions", session.id)}>{session.name}</Link>
      </th>
      <td>
        <Link to={at("rigs", session.asset)}>{session.asset}</Link>
      </td>
      <td>{clock(session.opened_at)}</td>
      <td class="n">{duration(length)}</td>
      <td class="n">{count(session.samples)}</td>
      <td>
        {session.state === "open" ? (
          <span class="status-open">● open</span>
        ) : (
          came && <span class={came.look}>{came.text}</span>
        )}
      </td>
    </tr>
  );
}

function DropZone({ take }: { take: (file: File) => void }) {
  const [over, setOver] = useState(false);
  const input = useRef<HTMLInputElement>(null);
  // Listening from the moment the words are there: an effect after the paint loses a file dropped at once.
  useLayoutEffect(() => {
    const has = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    const enter = (event: DragEvent) => {
      if (has(event)) {
        event.preventDefault();
        setOver(true);
      }
    };
    const leave = (event: DragEvent) => {
      if (!event.relatedTarget) setOver(false);
    };
    const drop = (event: DragEvent) => {
      event.preventDefault();
      setOver(false);
      const file = event.dataTransfer?.files[0];
      if (file) take(file);
    };
    addEventListener("dragover", enter);
    addEventListener("dragleave", leave);
    addEventListener("drop", drop);
    return () => {
      removeEventListener("dragover", enter);
      removeEventListener("dragleave", leave);
      removeEventListener("drop", drop);
    };
  }, []);
  return (
    <div class={`drop${over ? " over" : ""}`}>
      <input
        ref={input}
        type="file"
        accept=".csv,.txt,.tsv,text/csv"
        class="hidden"
        aria-label="Recording to import"
        tabIndex={-1}
        onChange={(e) => {
          const file = e.currentTarget.files?.[0];
          e.currentTarget.value = "";
          if (file) take(file);
        }}
      />
      <span>{over ? "Let go to import" : "Drop a recording (CSV) here, or"}</span>{" "}
      {!over && (
        <button type="button" onClick={() => input.current?.click()}>
          choose a file
        </button>
      )}
    </div>
  );
}
