// PETSc's TS at a constant step: TSSetType by its own options, no adaptation, linear equations solved by LU.
#include "spring.hpp"
#include <petscts.h>

static PetscErrorCode rhs(TS, PetscReal, Vec y, Vec f, void *p) {
    const Spring &s = *static_cast<Spring *>(p);
    const PetscScalar *a;
    PetscScalar *b;
    VecGetArrayRead(y, &a);
    VecGetArray(f, &b);
    b[0] = a[1];
    b[1] = -s.k * a[0] / s.m;
    VecRestoreArrayRead(y, &a);
    return VecRestoreArray(f, &b);
}

static PetscErrorCode jacobian(TS, PetscReal, Vec, Mat A, Mat, void *p) {
    const Spring &s = *static_cast<Spring *>(p);
    MatSetValue(A, 0, 1, 1, INSERT_VALUES);
    MatSetValue(A, 1, 0, -s.k / s.m, INSERT_VALUES);
    MatSetValue(A, 0, 0, 0, INSERT_VALUES);
    MatSetValue(A, 1, 1, 0, INSERT_VALUES);
    MatAssemblyBegin(A, MAT_FINAL_ASSEMBLY);
    return MatAssemblyEnd(A, MAT_FINAL_ASSEMBLY);
}

// of basicsymplectic: the velocity of the positions, the force of the momenta
static PetscErrorCode drift(TS, PetscReal, Vec v, Vec f, void *) { return VecCopy(v, f); }
static PetscErrorCode kick(TS, PetscReal, Vec q, Vec f, void *p) {
    const Spring &s = *static_cast<Spring *>(p);
    VecCopy(q, f);
    return VecScale(f, -s.k / s.m);
}

int main(int n, char **words) {
    if (n < 4) return std::printf("PETSc %d.%d.%d\n", PETSC_VERSION_MAJOR, PETSC_VERSION_MINOR, PETSC_VERSION_SUBMINOR), 0;
    const std::string name = words[1], type = name.substr(0, name.find('-'));
    const std::string own = name.size() > type.size() ? name.substr(type.size() + 1) : "";
    const std::string options = "-ts_type " + type + (own.empty() ? "" : " -ts_" + type + "_type " + own) +
        " -ts_adapt_type none -ksp_type preonly -pc_type lu -snes_type ksponly";
    Spring s = scene(words[2]);
    PetscInitialize(nullptr, nullptr, nullptr, nullptr);
    PetscOptionsInsertString(nullptr, options.c_str());
    TS ts; Vec y, f; Mat A; IS one, two;
    VecCreateSeq(PETSC_COMM_SELF, 2, &y);
    VecDuplicate(y, &f);
    MatCreateSeqDense(PETSC_COMM_SELF, 2, 2, nullptr, &A);
    TSCreate(PETSC_COMM_SELF, &ts);
    TSSetRHSFunction(ts, f, rhs, &s);
    TSSetRHSJacobian(ts, A, A, jacobian, &s);
    ISCreateStride(PETSC_COMM_SELF, 1, 0, 1, &one);
    ISCreateStride(PETSC_COMM_SELF, 1, 1, 1, &two);
    if (type == "basicsymplectic") {
        TSRHSSplitSetIS(ts, "position", one);
        TSRHSSplitSetIS(ts, "momentum", two);
        TSRHSSplitSetRHSFunction(ts, "position", nullptr, drift, &s);
        TSRHSSplitSetRHSFunction(ts, "momentum", nullptr, kick, &s);
    }
    TSSetExactFinalTime(ts, TS_EXACTFINALTIME_STEPOVER);
    TSSetMaxTime(ts, 1e30);
    TSSetMaxSteps(ts, 1 << 30);
    TSSetFromOptions(ts);
    TSSetSolution(ts, y);
    VecSetValue(y, 0, s.q, INSERT_VALUES);
    VecSetValue(y, 1, s.v, INSERT_VALUES);
    VecAssemblyBegin(y);
    VecAssemblyEnd(y);
    TSSetTimeStep(ts, s.h);
    TSSetUp(ts);
    return write(words[3], s, [&](double &q, double &v) {
        const PetscScalar *a;
        TSSetTimeStep(ts, s.h);
        if (TSStep(ts)) std::exit(2);
        VecGetArrayRead(y, &a);
        q = a[0]; v = a[1];
        VecRestoreArrayRead(y, &a);
    });
}
