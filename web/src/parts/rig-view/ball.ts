import {
  CircleGeometry,
  BackSide,
  DoubleSide,
  FrontSide,
  Group,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  SphereGeometry,
} from "three";
import { colour } from "../../theme";

/** The ball and the twin's. Of the latter the far side is drawn: a disc, and a rim around the ball where both are. */
const LOOKS = {
  ball: { colour: "measured", scale: 1, roughness: 0.25, metalness: 0.35, opacity: 1, shadow: 0.3 },
  ghost: { colour: "twin", scale: 1.15, roughness: 0.9, metalness: 0, opacity: 0.55, shadow: 0.12 },
};

/** Builds a ball with its shadow; it is invisible until it has a position. */
export function buildBall(kind: keyof typeof LOOKS, radius: number): Group {
  const look = LOOKS[kind];
  const isGhost = kind === "ghost";
  const material = new MeshStandardMaterial({
    color: colour(look.colour),
    roughness: look.roughness,
    metalness: look.metalness,
    transparent: isGhost,
    opacity: look.opacity,
    depthWrite: !isGhost,
    side: isGhost ? BackSide : FrontSide,
  });
  const sphere = new Mesh(new SphereGeometry(radius * look.scale, 40, 28), material);
  sphere.position.z = radius * look.scale;
  const shadow = new Mesh(
    new CircleGeometry(radius * 0.8, 32),
    new MeshBasicMaterial({ color: 0x000000, transparent: true, opacity: look.shadow, side: DoubleSide }),
  );
  shadow.position.z = 0.0004;
  const group = new Group();
  group.add(sphere, shadow);
  group.visible = false;
  return group;
}
