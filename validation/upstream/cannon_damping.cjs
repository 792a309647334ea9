// cannon-es takes a spring's `damping: 0` for 1, and `stiffness: 0` for 100.  npm install cannon-es
const { Body, Spring, Vec3, World } = require("cannon-es");
const M = 3.7, K = 29, H = 1 / 60, STEPS = 600; // ten seconds
const world = new World({ gravity: new Vec3(0, 0, 0) });
const wall = new Body({ mass: 0 });
const ball = new Body({ mass: M, linearDamping: 0, position: new Vec3(0.3, 0, 0) });
world.addBody(wall);
world.addBody(ball);
const spring = new Spring(wall, ball, { restLength: 0, stiffness: K, damping: 0 });
let q = 0.3, v = 0; // the law: semi-implicit Euler with a damping of 1
for (let i = 0; i < STEPS; i++) {
  spring.applyForce();
  world.step(H);
  v -= (H / M) * (K * q + 1 * v);
  q += H * v;
}
const energy = (q, v) => (K * q * q + M * v * v) / (K * 0.09);
const measured = energy(ball.position.x, ball.velocity.x);
console.log(`measured ${measured} law ${energy(q, v)} uncertainty 1e-12 promised 1`);
