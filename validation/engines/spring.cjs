// One mass on one spring by an engine of npm, as a program: node spring.cjs ENGINE[-ATTACHMENT] SCENE OUT
const fs = require("fs");
const [, , engine, from, to] = process.argv;
const scene = JSON.parse(fs.readFileSync(from, "utf8"));
const find = (x, key) => {
  if (x === null || typeof x !== "object") return undefined;
  if (key in x) return x[key];
  for (const y of Object.values(x)) { const z = find(y, key); if (z !== undefined) return z; }
};
const [m, k, h, steps, every] = ["mass", "stiffness", "step", "steps", "every"].map((x) => find(scene, x));
const q = find(scene, "position"), p = find(scene, "momentum");
const begin = {
  "cannon-es": () => {
    const { World, Body, Vec3 } = require("cannon-es");
    const world = new World({ gravity: new Vec3(0, 0, 0) });
    const ball = new Body({ mass: m, linearDamping: 0, position: new Vec3(q, 0, 0), velocity: new Vec3(p / m, 0, 0) });
    world.addBody(ball);
    return () => (ball.applyForce(new Vec3(-k * ball.position.x, 0, 0)), world.step(h), [ball.position.x, ball.velocity.x]);
  },
  p2: () => {
    const p2 = require("p2");
    const world = new p2.World({ gravity: [0, 0] });
    const ball = new p2.Body({ mass: m, damping: 0, position: [q, 0], velocity: [p / m, 0] });
    world.addBody(ball);
    return () => ((ball.force[0] = -k * ball.position[0]), world.step(h), [ball.position[0], ball.velocity[0]]);
  },
  planck: () => {
    const { World, Vec2, Circle } = require("planck");
    const world = new World({ gravity: Vec2(0, 0) });
    const ball = world.createBody({ type: "dynamic", position: Vec2(q, 0), linearVelocity: Vec2(p / m, 0) });
    ball.createFixture(new Circle(0.1), 1);
    ball.setMassData({ mass: m, center: Vec2(0, 0), I: 1 }), ball.setSleepingAllowed(false);
    return () => {
      ball.applyForceToCenter(Vec2(-k * ball.getPosition().x, 0), true);
      world.step(h);
      return [ball.getPosition().x, ball.getLinearVelocity().x];
    };
  },
  "planck-joint": () => {
    const { World, Vec2, Circle, DistanceJoint } = require("planck");
    const world = new World({ gravity: Vec2(0, 0) }), far = 100;
    const wall = world.createBody(), ball = world.createBody({ type: "dynamic", position: Vec2(q, 0), linearVelocity: Vec2(p / m, 0) });
    ball.createFixture(new Circle(0.1), 1);
    ball.setMassData({ mass: m, center: Vec2(0, 0), I: 1 }), ball.setSleepingAllowed(false);
    const shape = { frequencyHz: Math.sqrt(k / m) / 2 / Math.PI, dampingRatio: 0, length: far };
    world.createJoint(new DistanceJoint({ ...shape, bodyA: wall, bodyB: ball, localAnchorA: Vec2(-far, 0), localAnchorB: Vec2(0, 0) }));
    return () => (world.step(h), [ball.getPosition().x, ball.getLinearVelocity().x]);
  },
  "p2-spring": () => {
    const p2 = require("p2");
    const world = new p2.World({ gravity: [0, 0] }), wall = new p2.Body({ mass: 0 });
    const ball = new p2.Body({ mass: m, damping: 0, position: [q, 0], velocity: [p / m, 0] });
    world.addBody(wall), world.addBody(ball);
    world.addSpring(new p2.LinearSpring(wall, ball, { stiffness: k, damping: 0, restLength: 0 }));
    return () => (world.step(h), [ball.position[0], ball.velocity[0]]);
  },
  "cannon-es-spring": () => {
    const { World, Body, Vec3, Spring } = require("cannon-es");
    const world = new World({ gravity: new Vec3(0, 0, 0) }), wall = new Body({ mass: 0 }), far = 100;
    const ball = new Body({ mass: m, linearDamping: 0, position: new Vec3(q, 0, 0), velocity: new Vec3(p / m, 0, 0) });
    world.addBody(ball);
    const spring = new Spring(wall, ball, { stiffness: k, damping: 1e-300, restLength: far, localAnchorA: new Vec3(-far, 0, 0) });
    return () => (spring.applyForce(), world.step(h), [ball.position.x, ball.velocity.x]);
  },
  "matter-js": () => {
    const { Engine, Bodies, Body, Composite } = require("matter-js");
    const world = Engine.create({ gravity: { x: 0, y: 0 } });
    const ball = Bodies.circle(q, 0, 1, { frictionAir: 0 });
    Body.setMass(ball, m), Composite.add(world.world, ball), Body.setPosition(ball, { x: q, y: 0 });
    ball.positionPrev.x = q - (p / m) * h; // Verlet's velocity, in steps of its base of 1000/60 ms
    const dt = 1000 / 60;
    return () => {
      ball.force.x = (-k * ball.position.x * h * h) / dt / dt;
      Engine.update(world, dt);
      return [ball.position.x, (ball.position.x - ball.positionPrev.x) / h];
    };
  },
};
const step = begin[engine]();
const lines = ["t,q,p", [0, q, p].join(",")];
for (let i = 1; i <= steps; i++) {
  const [x, v] = step();
  if (i % every === 0) lines.push([i * h, x, v * m].join(","));
}
fs.writeFileSync(to, lines.join("\n") + "\n");
