// p2's RotationalSpring multiplies its damping by 0.  npm install p2
const p2 = require("p2");
const I = 3.7, K = 29, C = 2, H = 1 / 60, STEPS = 600; // ten seconds
const world = new p2.World({ gravity: [0, 0] });
const wall = new p2.Body({ mass: 0 });
const wheel = new p2.Body({ mass: 1, angularDamping: 0 });
wheel.updateMassProperties = () => {};
wheel.inertia = I;
wheel.invInertia = 1 / I;
wheel.invInertiaSolve = 1 / I;
world.addBody(wall);
world.addBody(wheel);
world.addSpring(new p2.RotationalSpring(wall, wheel, { restAngle: 0, stiffness: K, damping: C }));
wheel.angle = 0.3;
let law = [0.3, 0], promised = [0.3, 0]; // semi-implicit Euler without damping and with it
const step = ([q, v], c) => ((v -= (H / I) * (K * q + c * v)), [q + H * v, v]);
for (let i = 0; i < STEPS; i++) {
  world.step(H);
  [law, promised] = [step(law, 0), step(promised, C)];
}
const energy = ([q, v]) => (K * q * q + I * v * v) / (K * 0.09);
const measured = energy([wheel.angle, wheel.angularVelocity]);
console.log(`measured ${measured} law ${energy(law)} uncertainty 1e-12 promised ${energy(promised)}`);
