/** Converts between the set-up form and the asset file. */
import type { Asset } from "../../api/types";
import { DEFAULT_AXES } from "../../live/signs";

/** A description in the units of the form: mm, g and degrees. */
export interface Description {
  name: string;
  /** Samples per second. */
  rate: number;
  radius: number;
  mass: number;
  inertia: number;
  isRound: boolean;
  length: number;
  width: number;
  diameter: number;
  hasRim: boolean;
  /** Largest angle of the plate. */
  limit: number;
  /** One unit of the device in metres and in radians. */
  positionUnit: number;
  commandUnit: number;
  /** Settings of the diagnosis: NaN for those of the service. */
  debounce: number;
  falseAlarms: number;
}

/** The fields with typed numbers. */
export type NumberField = "rate" | "radius" | "mass" | "length" | "width" | "diameter" | "limit";

/** The fields with numbers that may be left empty. */
export type OptionalField = "debounce" | "falseAlarms";

/** Inertia factors: moment of inertia over mass times radius squared. */
export const SOLID = 0.4;
export const HOLLOW = 0.667;

/** One degree in radians. */
export const DEGREE = Math.PI / 180;

/** Rounds off binary noise, which the form would show. */
const rounded = (n: number) => Number(n.toPrecision(6));

/** The default dimensions of the service, for missing values. */
const DEFAULT = {
  rate: 100,
  ball: { radius_m: 0.0127, mass_kg: 0.051, inertia_factor: SOLID },
  plate: { length_m: 0.38, width_m: 0.24, diameter_m: 0.3, thickness_m: 0.003, rim: true },
  angle_limit_rad: 0.2,
};

const limitOfAsset = (asset?: Asset) => asset?.servo?.angle_limit_rad ?? DEFAULT.angle_limit_rad;

export function describeAsset(asset?: Asset): Description {
  const { plate, ball, axes, diagnostics } = asset ?? {};
  const millimetres = (m: number | null | undefined, fallback: number) => rounded((m ?? fallback) * 1e3);
  return {
    name: asset?.name ?? "",
    rate: asset?.sample_rate_hz ?? DEFAULT.rate,
    radius: millimetres(ball?.radius_m, DEFAULT.ball.radius_m),
    mass: rounded((ball?.mass_kg ?? DEFAULT.ball.mass_kg) * 1e3),
    inertia: ball?.inertia_factor ?? DEFAULT.ball.inertia_factor,
    isRound: plate?.diameter_m != null,
    length: millimetres(plate?.length_m, DEFAULT.plate.length_m),
    width: millimetres(plate?.width_m, DEFAULT.plate.width_m),
    diameter: millimetres(plate?.diameter_m, DEFAULT.plate.diameter_m),
    hasRim: plate?.rim ?? DEFAULT.plate.rim,
    limit: rounded(limitOfAsset(asset) / DEGREE),
    positionUnit: axes?.position_unit_m ?? DEFAULT_AXES.position_unit_m,
    commandUnit: axes?.command_unit_rad ?? DEFAULT_AXES.command_unit_rad,
    debounce: diagnostics?.debounce_s ?? NaN,
    falseAlarms: diagnostics?.false_alarms_per_rig_year ?? NaN,
  };
}

const DEFAULTS = describeAsset();

/** Whether a field has the default of the service, which nobody may have measured. */
export const isDefault = (description: Description, field: NumberField) =>
  description[field] === DEFAULTS[field];

/** Returns the settings of the diagnosis; undefined if all are those of the service. */
function diagnosticsOf({ debounce, falseAlarms }: Description, before?: Asset): Asset["diagnostics"] {
  const settings = { ...before?.diagnostics, debounce_s: debounce, false_alarms_per_rig_year: falseAlarms };
  const given = Object.entries(settings).filter(([, value]) => value != null && !Number.isNaN(value));
  return given.length ? Object.fromEntries(given) : undefined;
}

/** Returns the largest plate angle, rad: exactly that of before if the form shows its degrees, which are rounded. */
function limitOf(degrees: number, before?: Asset): number {
  const known = limitOfAsset(before);
  return degrees === rounded(known / DEGREE) ? known : degrees * DEGREE;
}

/** Returns the asset of a description; properties that are not in the form keep their values. */
export function assetOf(description: Description, before?: Asset): Asset {
  const { name, rate, radius, mass, inertia, isRound, length, width, diameter } = description;
  const { hasRim, limit, positionUnit, commandUnit } = description;
  const size = isRound ? { diameter_m: diameter / 1e3 } : { length_m: length / 1e3, width_m: width / 1e3 };
  const thickness_m = before?.plate?.thickness_m ?? DEFAULT.plate.thickness_m;
  const units = { position_unit_m: positionUnit, command_unit_rad: commandUnit };
  return {
    ...before,
    name,
    sample_rate_hz: rate,
    plate: { thickness_m, rim: hasRim, ...size },
    servo: { ...before?.servo, angle_limit_rad: limitOf(limit, before) },
    axes: { ...DEFAULT_AXES, ...before?.axes, ...units },
    ball: { radius_m: radius / 1e3, mass_kg: mass / 1e3, inertia_factor: inertia },
    diagnostics: diagnosticsOf(description, before),
  } as Asset;
}

/** Whether `name` is a valid name of a rig. */
export const isName = (name: string) => /^[A-Za-z0-9._-]{1,128}$/.test(name);
