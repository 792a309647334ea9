// A JSON line of each program: name, scheme, h, m, k, states.  node programs.mjs, beside its node_modules.
const M = 3.7, K = 2.9, Q = 0.3, V = 0.19, H = 0.1, N = 60
const out = (name, scheme, h, m, k, q, v, more = {}) => console.log(JSON.stringify({ name, scheme, h, m, k, q, v, ...more }))
const attempt = async (name, f) => { try { await f() } catch (e) { console.error(name, String(e).slice(0, 200)) } }

await attempt("cannon-es", async () => {
  const C = await import("cannon-es")
  const w = new C.World({ gravity: new C.Vec3(0, 0, 0) })
  const b = new C.Body({ mass: M, linearDamping: 0, position: new C.Vec3(Q, 0, 0), velocity: new C.Vec3(V, 0, 0) })
  w.addBody(b)
  const q = [Q], v = [V]
  for (let i = 0; i < N; i++) { b.force.x = -K * b.position.x; w.step(H); q.push(b.position.x); v.push(b.velocity.x) }
  out("cannon-es 0.20, a force", "semi-implicit-euler", H, M, K, q, v)
})
await attempt("matter-js", async () => {
  const X = (await import("matter-js")).default
  for (const [h, w2] of [[1 / 60, 30.0], [1 / 60, 0.784]]) {
    const e = X.Engine.create({ gravity: { x: 0, y: 0 } })
    const b = X.Bodies.circle(100 * Q, 0, 5, { frictionAir: 0 })
    X.Composite.add(e.world, b)
    const m = b.mass, q = [], v = [], ms = 1000 * h
    const kms = m * w2 / 1e6
    for (let i = 0; i <= N; i++) {
      q.push(b.position.x); v.push(X.Body.getVelocity(b).x * 60)
      X.Body.applyForce(b, b.position, { x: -kms * b.position.x, y: 0 })
      X.Engine.update(e, ms)
    }
    out(`matter-js 0.20, a force, w2 ${w2}`, "semi-implicit-euler", h, m, m * w2, q, v)
  }
})
await attempt("planck", async () => {
  const P = await import("planck")
  for (const joint of [false, true]) {
    const w = new P.World({ gravity: P.Vec2(0, 0), allowSleep: false })
    const b = w.createDynamicBody({ position: P.Vec2(Q, 0), linearVelocity: P.Vec2(V, 0), fixedRotation: true })
    b.createFixture(P.Box(0.5, 0.5), { density: M })
    const m = b.getMass()
    if (joint) {
      const a = w.createBody({ position: P.Vec2(-20, 0) })
      const j = w.createJoint(new P.DistanceJoint({ frequencyHz: Math.sqrt(K / m) / 2 / Math.PI, dampingRatio: 0, length: 20, bodyA: a, bodyB: b, localAnchorA: P.Vec2(0, 0), localAnchorB: P.Vec2(0, 0) }))
    }
    const q = [Q], v = [V]
    for (let i = 0; i < N; i++) {
      if (!joint) b.applyForceToCenter(P.Vec2(-K * b.getPosition().x, 0), true)
      w.step(H)
      q.push(b.getPosition().x); v.push(b.getLinearVelocity().x)
    }
    out(`planck 1.4, ${joint ? "DistanceJoint of a frequency" : "a force"}`, joint ? "implicit-euler" : "semi-implicit-euler", H, m, K, q, v)
  }
})
await attempt("p2-es", async () => {
  const p2 = await import("p2-es")
  for (const spring of [false, true]) {
    const w = new p2.World({ gravity: [0, 0] })
    w.applyDamping = false
    const b = new p2.Body({ mass: M, position: [Q, 0], velocity: [V, 0], damping: 0, angularDamping: 0, fixedRotation: true })
    w.addBody(b)
    if (spring) {
      const a = new p2.Body({ mass: 0, position: [-20, 0] }); w.addBody(a)
      w.addSpring(new p2.LinearSpring(a, b, { stiffness: K, damping: 0, restLength: 20 }))
    }
    const q = [Q], v = [V]
    for (let i = 0; i < N; i++) { if (!spring) b.force[0] = -K * b.position[0]; w.step(H); q.push(b.position[0]); v.push(b.velocity[0]) }
    out(`p2-es 1.2, ${spring ? "LinearSpring" : "a force"}`, "semi-implicit-euler", H, M, K, q, v)
  }
})
await attempt("rapier2d", async () => {
  const R = (await import("@dimforge/rapier2d-compat")).default
  await R.init()
  const w = new R.World({ x: 0, y: 0 }); w.timestep = H
  const b = w.createRigidBody(R.RigidBodyDesc.dynamic().setTranslation(Q, 0).setLinvel(V, 0).setCanSleep(false).lockRotations().setAdditionalMass(M))
  const q = [], v = []
  for (let i = 0; i <= N; i++) {
    q.push(b.translation().x); v.push(b.linvel().x)
    b.resetForces(true); b.addForce({ x: -K * b.translation().x, y: 0 }, true); w.step()
  }
  out("rapier2d-compat, a force", "held-force", H, M, K, q, v)
})
for (const [p, s] of [["ode-euler", "explicit-euler"], ["ode-midpoint", "rk2-midpoint"], ["ode-rk4", "rk4"]]) await attempt(p, async () => {
  const f = (await import(p)).default
  const y = [Q, V], i = f(y, (d, y) => { d[0] = y[1]; d[1] = -K / M * y[0] }, 0, H)
  const q = [Q], v = [V]
  for (let n = 0; n < N; n++) { i.step(); q.push(i.y[0]); v.push(i.y[1]) }
  out(p, s, H, M, K, q, v)
})
await attempt("rebound", async () => {
  const r = (await import("rebound")).default
  const looper = new r.SteppingSimulationLooper(), sys = new r.SpringSystem(looper)
  const s = sys.createSpringWithConfig({ tension: 400, friction: 0 })
  s.setRestSpeedThreshold(0); s.setRestDisplacementThreshold(0); s.setOvershootClampingEnabled(false)
  s.setCurrentValue(Q, true); s.setVelocity(V); s.setEndValue(0)
  const q = [], v = []
  q.push(s._currentState.position); v.push(s._currentState.velocity)
  for (let i = 0; i < 100; i++) { s.advance(0, 0.001); const c = s._currentState; q.push(c.position); v.push(c.velocity) }
  // its first slope is that of the place where the step before left its last stage
  out("rebound.js 0.1 (springs of user interfaces)", "memory", 0.001, 1, 400, q, v)
})
await attempt("d3-force", async () => {
  const d = await import("d3-force")
  const n = { x: 30, y: 0, vx: 1.9, vy: 0 }
  const s = d.forceSimulation([n]).stop().alpha(0.5).alphaTarget(0.5).alphaDecay(0).velocityDecay(0).force("x", d.forceX(0).strength(0.02))
  n.x = 30; n.vx = 1.9
  const q = [n.x], v = [n.vx]
  for (let i = 0; i < N; i++) { s.tick(); q.push(n.x); v.push(n.vx) }
  out("d3-force 3.0, forceX without decay", "semi-implicit-euler", 1, 1, 0.01, q, v)
  s.velocityDecay(0.05); n.x = 30; n.vx = 1.9
  const a = [n.x], b = [n.vx]
  for (let i = 0; i < N; i++) { s.tick(); a.push(n.x); b.push(n.vx) }
  out("d3-force 3.0, forceX with velocityDecay 0.05", "semi-implicit-euler", 1, 1, 0.01, a, b, { damped: 0.05 })
})
