/** A dropped file becomes a session: its columns are mapped, looked at, and checked. */
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { api } from "../api/client";
import type { Import } from "../api/types";
import {
  apply,
  checkSigns,
  guess,
  judge,
  readTable,
  ROLE_WORDS,
  ROLES,
  toCsv,
  UNITS,
  type Columns,
  type Mapping,
  type Role,
  type Table,
} from "../live/csv";
import { Act, Dialogue } from "../parts/bits";
import { at, go } from "../router";
import { colour } from "../theme";
import { count, millimetres, number, seconds } from "../words";

interface Props {
  file: File;
  assets: string[];
  asset?: string;
  close: () => void;
}

/** Longest file that is read here, bytes: the service takes no longer one either, by default. */
const MAX_BYTES = 64 << 20;

export function ImportDialogue({ file, assets, asset: wanted, close }: Props) {
  const [table, setTable] = useState<Table>();
  const [mapping, setMapping] = useState<Mapping>();
  const [problem, setProblem] = useState<string>();
  const [chosen, setAsset] = useState(wanted);
  const asset = chosen ?? assets[0] ?? "";
  const [name, setName] = useState(file.name.replace(/\.\w+$/, ""));
  const [done, setDone] = useState<Import>();
  useEffect(() => {
    const read = async () => {
      if (file.size > MAX_BYTES) throw new Error("The file is longer than 64 MiB; split it.");
      const found = readTable(await file.text());
      setTable(found);
      setMapping(guess(found));
    };
    read().catch((error: Error) => setProblem(error.message));
  }, [file]);
  const columns = useMemo(() => (table && mapping ? apply(table, mapping) : undefined), [table, mapping]);
  const missing = mapping ? ROLES.filter((role) => mapping[role].index === null) : [];
  const send = async () => {
    if (!assets.includes(asset)) await api.createAsset({ name: asset });
    const imported = await api.importCsv(asset, name, toCsv(columns!));
    if (imported.rejected + imported.late === 0) return go(at("sessions", imported.session.id));
    setDone(imported);
  };
  return (
    <Dialogue title={`Import ${file.name}`} close={close}>
      {problem && (
        <p class="trouble" role="alert">
          {problem}
        </p>
      )}
      {!problem && !table && (
        <p class="quiet" role="status">
          Reading the file…
        </p>
      )}
      {done && <Outcome of={done} />}
      {!done && table && mapping && columns && (
        <>
          <div class="form-row">
            <label>
              Rig{" "}
              <input
                list="import-assets"
                value={asset}
                onInput={(e) => setAsset(e.currentTarget.value)}
                placeholder="name of the rig"
              />
            </label>
            <datalist id="import-assets">
              {assets.map((each) => (
                <option value={each} />
              ))}
            </datalist>
            <label>
              Session <input value={name} onInput={(e) => setName(e.currentTarget.value)} />
            </label>
          </div>
          {!assets.includes(asset) && asset && (
            <p class="note">
              There is no rig <b>{asset}</b> yet; it is registered as the book chapter's rig. Its set-up can
              be changed later.
            </p>
          )}
          <Columns table={table} mapping={mapping} change={setMapping} />
          <Preview columns={columns} />
          <Sanity columns={columns} mapping={mapping} change={setMapping} />
          <div class="form-end">
            {missing.length > 0 && (
              <span class="quiet">Still to choose: {missing.map((role) => ROLE_WORDS[role]).join(", ")}</span>
            )}
            <button type="button" onClick={close}>
              Cancel
            </button>
            <Act
              class="primary"
              act={send}
              disabled={
                !asset || missing.includes("t_s") || missing.includes("x_m") || missing.includes("y_m")
              }
            >
              Import {count(table.rows.length)} rows
            </Act>
          </div>
        </>
      )}
    </Dialogue>
  );
}

function Columns({
  table,
  mapping,
  change,
}: {
  table: Table;
  mapping: Mapping;
  change: (to: Mapping) => void;
}) {
  const set = (role: Role, part: Partial<Mapping[Role]>) =>
    change({ ...mapping, [role]: { ...mapping[role], ...part } });
  return (
    <div class="scroll">
      <table class="mapping">
        <thead>
          <tr>
            <th>Is</th>
            <th>Column</th>
            <th>Unit</th>
            <th>Sign</th>
            <th>First values</th>
          </tr>
        </thead>
        <tbody>
          {ROLES.map((role) => {
            const column = mapping[role];
            return (
              <tr>
                <th scope="row">{ROLE_WORDS[role]}</th>
                <td>
                  <select
                    aria-label={`Column of ${ROLE_WORDS[role]}`}
                    value={column.index ?? ""}
                    onChange={(e) =>
                      set(role, {
                        index: e.currentTarget.value === "" ? null : Number(e.currentTarget.value),
                      })
                    }
                  >
                    <option value="">none</option>
                    {table.header.map((name, i) => (
                      <option value={i}>{name || `column ${i + 1}`}</option>
                    ))}
                  </select>
                </td>
                <td>
                  <select
                    aria-label={`Unit of ${ROLE_WORDS[role]}`}
                    value={column.factor}
                    onChange={(e) => set(role, { factor: Number(e.currentTarget.value) })}
                  >
                    {UNITS[role].map((unit) => (
                      <option value={unit.factor}>{unit.word}</option>
                    ))}
                  </select>
                </td>
                <td>
                  {role === "t_s" ? (
                    ""
                  ) : (
                    <select
                      aria-label={`Sign of ${ROLE_WORDS[role]}`}
                      value={column.sign}
                      onChange={(e) => set(role, { sign: Number(e.currentTarget.value) as 1 | -1 })}
                    >
                      <option value={1}>+</option>
                      <option value={-1}>−</option>
                    </select>
                  )}
                </td>
                <td class="quiet clip">
                  {column.index === null
                    ? ""
                    : table.rows
                        .slice(0, 4)
                        .map((row) => row[column.index!] || "empty")
                        .join(", ")}
                </td>
              </tr>
            );
          })}
        </tbody>
      </table>
    </div>
  );
}

const finite = (column: (number | null)[]) => column.filter((value): value is number => value !== null);
const span = (values: number[]) =>
  values.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)] as [number, number], [
    Infinity,
    -Infinity,
  ] as [number, number]);

function Preview({ columns }: { columns: Columns }) {
  const canvas = useRef<HTMLCanvasElement>(null);
  useEffect(() => drawPreview(canvas.current!, columns), [columns]);
  const t = finite(columns.t_s);
  const length = t.length > 1 ? t[t.length - 1]! - t[0]! : 0;
  const seen = columns.x_m.filter((x, i) => x !== null && columns.y_m[i] !== null).length;
  const [low, high] = span(finite(columns.x_m)),
    [lowY, highY] = span(finite(columns.y_m));
  const steepest = Math.max(
    ...finite(columns.cmd_qx_rad).map(Math.abs),
    ...finite(columns.cmd_qy_rad).map(Math.abs),
    0,
  );
  return (
    <div class="preview">
      <canvas ref={canvas} class="xy" role="img" aria-label="The ball's way in the file" />
      <ul class="plain">
        <li>
          {count(t.length)} rows over {seconds(length, 1)}:{" "}
          {number(length > 0 ? (t.length - 1) / length : null, 1, "Hz")}
        </li>
        <li>Ball seen in {number((100 * seen) / Math.max(t.length, 1), 0, "%")} of the rows</li>
        <li>
          x from {millimetres(Number.isFinite(low) ? low : null, 0)} to{" "}
          {millimetres(Number.isFinite(high) ? high : null, 0)}, y from{" "}
          {millimetres(Number.isFinite(lowY) ? lowY : null, 0)} to{" "}
          {millimetres(Number.isFinite(highY) ? highY : null, 0)}
        </li>
        <li>Steepest command {number((steepest * 180) / Math.PI, 1, "°")}</li>
      </ul>
    </div>
  );
}

/** Points drawn at most. */
const MOST = 4000;

function drawPreview(canvas: HTMLCanvasElement, columns: Columns): void {
  const { clientWidth: width, clientHeight: height } = canvas;
  Object.assign(canvas, { width: width * devicePixelRatio, height: height * devicePixelRatio });
  const context = canvas.getContext("2d")!;
  context.scale(devicePixelRatio, devicePixelRatio);
  const [low, high] = span(finite(columns.x_m)),
    [lowY, highY] = span(finite(columns.y_m));
  if (!Number.isFinite(low) || !Number.isFinite(lowY)) return;
  const scale = Math.min(
    (width - 20) / Math.max(high - low, 1e-6),
    (height - 20) / Math.max(highY - lowY, 1e-6),
  );
  context.strokeStyle = colour("measured");
  context.lineWidth = 1.2;
  context.beginPath();
  const step = Math.max(Math.floor(columns.t_s.length / MOST), 1);
  let isDown = false;
  for (let i = 0; i < columns.t_s.length; i += step) {
    const x = columns.x_m[i],
      y = columns.y_m[i];
    if (x == null || y == null) {
      isDown = false;
      continue;
    }
    const place: [number, number] = [
      width / 2 + (x - (low + high) / 2) * scale,
      height / 2 - (y - (lowY + highY) / 2) * scale,
    ];
    if (isDown) context.lineTo(...place);
    else context.moveTo(...place);
    isDown = true;
  }
  context.stroke();
}

const LIMITS = { position_m: 2, angle_rad: 1.6 };

function Sanity({
  columns,
  mapping,
  change,
}: {
  columns: Columns;
  mapping: Mapping;
  change: (to: Mapping) => void;
}) {
  const check = useMemo(() => checkSigns(columns), [columns]);
  const verdicts = { x: judge(check.x), y: judge(check.y) };
  const t = finite(columns.t_s);
  const back = t.slice(1).filter((value, i) => value <= t[i]!).length;
  const far = [...finite(columns.x_m), ...finite(columns.y_m)].some((v) => Math.abs(v) > LIMITS.position_m);
  const steep = [...finite(columns.cmd_qx_rad), ...finite(columns.cmd_qy_rad)].some(
    (v) => Math.abs(v) > LIMITS.angle_rad,
  );
  const swap = () => change({ ...mapping, x_m: mapping.y_m, y_m: mapping.x_m });
  const flip = (role: Role) =>
    change({ ...mapping, [role]: { ...mapping[role], sign: mapping[role].sign === 1 ? -1 : 1 } });
  return (
    <ul class="sanity" aria-label="Sanity check">
      {back > 0 && <li class="warn">Time stands still or goes back in {count(back)} rows.</li>}
      {far && <li class="warn">The ball is metres away: is the unit of its position right?</li>}
      {steep && <li class="warn">The plate tilts beyond 90°: is the unit of the commands right?</li>}
      {(["x", "y"] as const).map((axis) => {
        const role = axis === "x" ? "x_m" : "y_m",
          verdict = verdicts[axis];
        const command = axis === "x" ? "+qy moves the ball toward +x" : "+qx moves the ball toward −y";
        const strength = number(check[axis].own, 2);
        if (verdict === "agrees")
          return (
            <li class="good">
              {axis}: {command}, as it should (correlation {strength}).
            </li>
          );
        if (verdict === "reversed")
          return (
            <li class="warn">
              {axis}: the ball goes the other way ({command} is the rule; correlation {strength}).{" "}
              <button type="button" class="small" onClick={() => flip(role)}>
                Flip {axis}
              </button>
            </li>
          );
        if (verdict === "swapped")
          return (
            <li class="warn">
              {axis}: the ball follows the other command.{" "}
              <button type="button" class="small" onClick={swap}>
                Swap x and y
              </button>
            </li>
          );
        return (
          <li>
            {axis}: cannot tell the sign; the ball hardly moves with the command (correlation {strength}).
          </li>
        );
      })}
    </ul>
  );
}

function Outcome({ of }: { of: Import }) {
  return (
    <div>
      <p role="status">
        {count(of.accepted)} samples are in. {count(of.rejected)} rows were no samples, {count(of.late)} came
        too late to be judged, {count(of.duplicate)} were there already.
      </p>
      {of.rejections.length > 0 && (
        <ul class="plain quiet">
          {of.rejections.slice(0, 8).map((row) => (
            <li>
              row {row.index + 2}: {row.reason}
            </li>
          ))}
        </ul>
      )}
      <div class="form-end">
        <button type="button" class="primary" onClick={() => go(at("sessions", of.session.id))}>
          Open the session
        </button>
      </div>
    </div>
  );
}
