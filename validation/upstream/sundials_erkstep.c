/* SUNDIALS 6.4.1: ERKStep takes Heun-Euler's last stage for the first of the next step.  apt-get install
   libsundials-dev; cc sundials_erkstep.c -lsundials_arkode -lsundials_nvecserial -lsundials_generic -lm */
#include <arkode/arkode_erkstep.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
static const double M = 3.7, K = 2.9, H = 0.1;
static int spring(double t, N_Vector y, N_Vector f, void *user) {
  NV_Ith_S(f, 0) = NV_Ith_S(y, 1) / M;
  NV_Ith_S(f, 1) = -K * NV_Ith_S(y, 0);
  return 0;
}
int main(void) {
  SUNContext context;
  SUNContext_Create(NULL, &context);
  N_Vector y = N_VNew_Serial(2, context);
  double t, q = NV_Ith_S(y, 0) = 0.3, p = NV_Ith_S(y, 1) = 0.7, u = q, v = p, a = p / M, b = -K * q;
  void *erk = ERKStepCreate(spring, 0.0, y, context);
  ERKStepSStolerances(erk, 1e-6, 1e-9);
  ERKStepSetTableNum(erk, ARKODE_HEUN_EULER_2_1_2);
  ERKStepSetFixedStep(erk, H);
  for (int i = 1; i <= 100; i++) {
    ERKStepEvolve(erk, i * H, y, &t, ARK_ONE_STEP);
    double c = (p + H * b) / M, d = -K * (q + H * a); /* the law: c, d stay for the next a, b */
    q += H / 2 * (a + c), p += H / 2 * (b + d), a = c, b = d;
    double e = v / M, f = -K * u, g = (v + H * f) / M, h = -K * (u + H * e); /* Heun's method */
    u += H / 2 * (e + g), v += H / 2 * (f + h);
  }
  printf("measured %.15f law %.15f uncertainty 1e-13 promised %.15f\n", NV_Ith_S(y, 0), q, u);
}
