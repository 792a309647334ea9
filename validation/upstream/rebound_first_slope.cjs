// rebound: RK4's first slope is taken where the step before left its last stage.  npm install rebound
const rebound = require("rebound");
const K = 400, X = 0.3, H = 0.001, STEPS = 10000; // ten seconds of a spring let go of, without friction
const looper = new rebound.SteppingSimulationLooper();
const spring = new rebound.SpringSystem(looper).createSpringWithConfig({ tension: K, friction: 0 });
spring.setCurrentValue(X);
spring.setRestSpeedThreshold(0);
spring.setRestDisplacementThreshold(0);
spring.setEndValue(0);
for (let i = 0; i < STEPS; i++) spring.advance(0, H);
const energy = (x, v) => (v * v + K * x * x) / (K * X * X);
function steps(keeps) { // RK4; if it keeps, the first slope is that of where the last stage was
  let x = X, v = 0, at = X;
  for (let i = 0; i < STEPS; i++) {
    const a = -K * (keeps ? at : x), vb = v + (a * H) / 2;
    const b = -K * (x + (v * H) / 2), vc = v + (b * H) / 2;
    const c = -K * (x + (vb * H) / 2), vd = v + c * H;
    const d = -K * (at = x + vc * H);
    x += (H / 6) * (v + 2 * vb + 2 * vc + vd);
    v += (H / 6) * (a + 2 * b + 2 * c + d);
  }
  return energy(x, v);
}
const measured = energy(spring.getCurrentValue(), spring.getVelocity());
console.log(`measured ${measured} law ${steps(true)} uncertainty 1e-12 promised ${steps(false)}`);
