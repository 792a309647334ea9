// Open Dynamics Engine: a body pulled by a force before each step, or held by a slider's stops as a spring.
#include "spring.hpp"
#include <ode/ode.h>

int main(int n, char **words) {
    if (n < 4) return std::puts("ODE " VERSION), 0;
    const Spring s = scene(words[2]);
    const std::string name = words[1];
    dInitODE2(0);
    dWorldID world = dWorldCreate();
    dBodyID body = dBodyCreate(world);
    dMass mass;
    dMassSetSphereTotal(&mass, s.m, 0.1);
    dBodySetMass(body, &mass);
    dBodySetPosition(body, s.q, 0, 0);
    dBodySetLinearVel(body, s.v, 0, 0);
    dBodySetAutoDisableFlag(body, 0);
    if (name == "slider") {
        // the manual's spring: ERP = h k/(h k + c), CFM = 1/(h k + c), c = 0
        dBodySetPosition(body, 0, 0, 0);
        dJointID slider = dJointCreateSlider(world, nullptr);
        dJointAttach(slider, body, nullptr);
        dJointSetSliderAxis(slider, 1, 0, 0);
        dBodySetPosition(body, s.q, 0, 0);
        dJointSetSliderParam(slider, dParamLoStop, 0);
        dJointSetSliderParam(slider, dParamHiStop, 0);
        dJointSetSliderParam(slider, dParamStopERP, 1);
        dJointSetSliderParam(slider, dParamStopCFM, 1 / (s.h * s.k));
    }
    return write(words[3], s, [&](double &q, double &v) {
        if (name != "slider") dBodyAddForce(body, -s.k * dBodyGetPosition(body)[0], 0, 0);
        (name == "quick" ? dWorldQuickStep : dWorldStep)(world, s.h);
        q = dBodyGetPosition(body)[0];
        v = dBodyGetLinearVel(body)[0];
    });
}
