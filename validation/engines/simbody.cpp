// Simbody: a slider on a spring of its mobility, by its integrators at a fixed step.
#include "spring.hpp"
#include <Simbody.h>
#include <memory>

using namespace SimTK;

int main(int n, char **words) {
    int a, b, c;
    SimTK_version_simbody(&a, &b, &c);
    if (n < 4) return std::printf("Simbody %d.%d.%d\n", a, b, c), 0;
    const Spring s = scene(words[2]);
    const std::string name = words[1];
    MultibodySystem system;
    SimbodyMatterSubsystem matter(system);
    GeneralForceSubsystem forces(system);
    Body::Rigid body(MassProperties(s.m, Vec3(0), Inertia(1)));
    MobilizedBody::Slider slider(matter.Ground(), Transform(), body, Transform());
    Force::MobilityLinearSpring spring(forces, slider, MobilizerQIndex(0), s.k, 0);
    State state = system.realizeTopology();
    slider.setOneQ(state, 0, s.q);
    slider.setOneU(state, 0, s.v);
    std::unique_ptr<Integrator> way;
    if (name == "explicit-euler") way = std::make_unique<ExplicitEulerIntegrator>(system);
    if (name == "semi-explicit-euler") way = std::make_unique<SemiExplicitEulerIntegrator>(system, s.h);
    if (name == "verlet") way = std::make_unique<VerletIntegrator>(system);
    if (name == "runge-kutta2") way = std::make_unique<RungeKutta2Integrator>(system);
    if (name == "runge-kutta3") way = std::make_unique<RungeKutta3Integrator>(system);
    if (name == "runge-kutta-merson") way = std::make_unique<RungeKuttaMersonIntegrator>(system);
    if (!way) return 2;
    way->setFixedStepSize(s.h);
    way->setAccuracy(1e-3);
    way->initialize(state);
    long i = 0;
    return write(words[3], s, [&](double &q, double &v) {
        const double to = ++i * s.h;
        way->setReturnEveryInternalStep(false);
        while (way->getTime() < to) way->stepTo(to, to);
        q = slider.getOneQ(way->getState(), 0);
        v = slider.getOneU(way->getState(), 0);
    });
}
