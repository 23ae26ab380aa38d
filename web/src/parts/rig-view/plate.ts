/** The plate in 3D: slab, edges, grid, and the foot below it. */
import {
  BoxGeometry,
  BufferGeometry,
  ConeGeometry,
  CylinderGeometry,
  EdgesGeometry,
  Float32BufferAttribute,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshStandardMaterial,
  type Object3D,
} from "three";
import type { Asset } from "../../api/types";
import { plateSize, type PlateSize } from "../../live/rig-size";
import { colour } from "../../theme";

/** Distance between grid lines, m. */
const GRID_M = 0.05;

/** Height of the grid above the plate, so that it is visible, m. */
const GRID_HEIGHT_M = 0.0002;

/** Smallest drawn thickness, so that the plate is visible from the side, m. */
const MIN_THICKNESS_M = 0.004;

const thickness = ({ plate }: Asset) => Math.max(plate?.thickness_m ?? 0, MIN_THICKNESS_M);

/** Builds the parts that turn with the plate; its upper face is at z = 0. */
export function buildPlate(asset: Asset): Object3D[] {
  const size = plateSize(asset);
  const height = thickness(asset);
  const shape = size.isRound
    ? new CylinderGeometry(size.length / 2, size.length / 2, height, 96).rotateX(Math.PI / 2)
    : new BoxGeometry(size.length, size.width, height);
  const material = new MeshStandardMaterial({ color: colour("plate"), roughness: 0.65, metalness: 0.1 });
  const slab = new Mesh(shape, material);
  slab.position.z = -height / 2;
  const edges = new LineSegments(
    new EdgesGeometry(shape, 30),
    new LineBasicMaterial({ color: colour("edge") }),
  );
  edges.position.copy(slab.position);
  return [slab, edges, buildGrid(size)];
}

/** Builds the foot, which does not turn. `size` is the longer side of the plate, m. */
export function buildFoot(asset: Asset, size: number): Object3D {
  const shape = new ConeGeometry(size * 0.05, size * 0.22, 32);
  const foot = new Mesh(shape, new MeshStandardMaterial({ color: colour("edge"), roughness: 0.8 }));
  foot.rotation.x = Math.PI / 2;
  foot.position.z = -thickness(asset) - size * 0.11;
  return foot;
}

function buildGrid({ length, width, isRound }: PlateSize): LineSegments {
  const points: number[] = [];
  // Half the length of a grid line at `offset` from the centre of a round or rectangular plate.
  const end = (offset: number, side: number) =>
    isRound ? Math.sqrt(Math.max((length / 2) ** 2 - offset * offset, 0)) : side / 2;
  for (let x = -Math.floor(length / 2 / GRID_M) * GRID_M; x <= length / 2; x += GRID_M) {
    const y = end(x, width);
    points.push(x, -y, GRID_HEIGHT_M, x, y, GRID_HEIGHT_M);
  }
  for (let y = -Math.floor(width / 2 / GRID_M) * GRID_M; y <= width / 2; y += GRID_M) {
    const x = end(y, length);
    points.push(-x, y, GRID_HEIGHT_M, x, y, GRID_HEIGHT_M);
  }
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
  const material = new LineBasicMaterial({ color: colour("edge"), transparent: true, opacity: 0.35 });
  return new LineSegments(geometry, material);
}
