/* Two behaviours with the binary interface of MFront's `generic` interface, written by hand: what a library compiled by
 * `mfront --obuild --interface=generic` exports, as far as a caller needs it. The structure and the symbols are those of MGIS 3.1
 * (BehaviourDataView.hxx, StateView.hxx) and TFEL 5.1.0 (BehaviourData.h, State.h), API version 1.
 *
 * SofteningNeoHooke, finite strain: P = eta P0, with P0 = mu (F - F^-T) + lambda ln J F^-T and its energy W. The internal variable is the
 * greatest energy M so far. Below it the material is softer: eta = 1 - r (1 - W/M).
 * Elasticity, small strain: Hooke's law, with the elastic properties that the caller puts first. */
#include <math.h>
#include <stdio.h>
#include <string.h>

struct state {
  const double *gradients;
  double *thermodynamic_forces;
  const double *mass_density;
  const double *material_properties;
  double *internal_state_variables;
  double *stored_energy;
  double *dissipated_energy;
  const double *external_state_variables;
};

struct behaviour_data {
  char *error_message;
  double dt;
  double *K;
  double *rdt;
  double *speed_of_sound;
  struct state s0, s1;
};

#define BEHAVIOUR(NAME, TYPE, KINEMATIC, GRADIENT, GRADIENT_TYPE)          \
  const char *NAME##_mfront_ept = #NAME;                                   \
  const char *NAME##_tfel_version = "5.1.0";                               \
  const char *NAME##_mfront_interface = "Generic";                         \
  const char *NAME##_src = "like_mfront.c";                                \
  unsigned short NAME##_mfront_mkt = 1;                                    \
  unsigned short NAME##_api_version = 1;                                   \
  unsigned short NAME##_BehaviourType = TYPE;                              \
  unsigned short NAME##_BehaviourKinematic = KINEMATIC;                    \
  unsigned short NAME##_SymmetryType = 0;                                  \
  unsigned short NAME##_ElasticSymmetryType = 0;                           \
  unsigned short NAME##_TemperatureRemovedFromExternalStateVariables = 1;  \
  unsigned short NAME##_requiresThermalExpansionCoefficientTensor = 0;     \
  unsigned short NAME##_nModellingHypotheses = 2;                          \
  const char *NAME##_ModellingHypotheses[2] = {"PlaneStrain", "Tridimensional"}; \
  unsigned short NAME##_nGradients = 1;                                    \
  int NAME##_GradientsTypes[1] = {GRADIENT_TYPE};                          \
  const char *NAME##_Gradients[1] = {GRADIENT};                            \
  unsigned short NAME##_nThermodynamicForces = 1;                          \
  int NAME##_ThermodynamicForcesTypes[1] = {1};                            \
  const char *NAME##_ThermodynamicForces[1] = {"Stress"};                  \
  unsigned short NAME##_nExternalStateVariables = 0;                       \
  const char *const *NAME##_ExternalStateVariables = 0;                    \
  const int *NAME##_ExternalStateVariablesTypes = 0;

BEHAVIOUR(SofteningNeoHooke, 2, 3, "DeformationGradient", 3)
unsigned short SofteningNeoHooke_requiresStiffnessTensor = 0;
unsigned short SofteningNeoHooke_nMaterialProperties = 3;
const char *SofteningNeoHooke_MaterialProperties[3] = {"FirstLameCoefficient", "ShearModulus", "Softening"};
unsigned short SofteningNeoHooke_nInternalStateVariables = 1;
const char *SofteningNeoHooke_InternalStateVariables[1] = {"GreatestEnergy"};
int SofteningNeoHooke_InternalStateVariablesTypes[1] = {0};

BEHAVIOUR(Elasticity, 1, 1, "Strain", 1)
unsigned short Elasticity_requiresStiffnessTensor = 1;
unsigned short Elasticity_nMaterialProperties = 0;
const char *const *Elasticity_MaterialProperties = 0;
/* The elastic strain, a symmetric tensor, which the caller rotates. */
unsigned short Elasticity_nInternalStateVariables = 1;
const char *Elasticity_InternalStateVariables[1] = {"ElasticStrain"};
int Elasticity_InternalStateVariablesTypes[1] = {1};

/* MFront's order of a tensor's components: 11, 22, 33, 12, 21, 13, 31, 23, 32. */
static const int row[9] = {0, 1, 2, 0, 1, 0, 2, 1, 2}, column[9] = {0, 1, 2, 1, 0, 2, 0, 2, 1};

static int fails(struct behaviour_data *d, const char *message) {
  if (d->error_message) snprintf(d->error_message, 512, "%s", message);
  *d->rdt = 0.1;
  return -1;
}

static double inverse(double F[3][3], double inverse[3][3]) {
  double det = 0;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      const int a = (i + 1) % 3, b = (i + 2) % 3, c = (j + 1) % 3, e = (j + 2) % 3;
      inverse[j][i] = F[a][c] * F[b][e] - F[a][e] * F[b][c];
    }
  for (int j = 0; j < 3; j++) det += F[0][j] * inverse[j][0];
  for (int i = 0; i < 9; i++) inverse[i / 3][i % 3] /= det;
  return det;
}

static int softening_neo_hooke(struct behaviour_data *d, int size) {
  const double *p = d->s1.material_properties, lambda = p[0], mu = p[1], r = p[2];
  if (d->K[0] < 3.5 || d->K[1] < 1.5 || d->K[2] < 1.5) return fails(d, "only PK1 and dPK1/dF are computed");
  double F[3][3] = {{0}}, G[3][3], P[9], squares = 0;
  for (int m = 0; m < size; m++) F[row[m]][column[m]] = d->s1.gradients[m];
  const double det = inverse(F, G);
  if (!(det > 0)) return fails(d, "det F is not positive");
  for (int i = 0; i < 9; i++) squares += F[i / 3][i % 3] * F[i / 3][i % 3];
  const double W = mu / 2 * (squares - 3 - 2 * log(det)) + lambda / 2 * log(det) * log(det);
  const double greatest = *d->s0.internal_state_variables;
  const int softer = W < greatest;
  const double eta = softer ? 1 - r * (1 - W / greatest) : 1, slope = softer ? r / greatest : 0;
  for (int m = 0; m < size; m++) {
    const int i = row[m], j = column[m];
    P[m] = mu * (F[i][j] - G[j][i]) + lambda * log(det) * G[j][i];
  }
  for (int m = 0; m < size; m++)
    for (int n = 0; n < size; n++) {
      const int i = row[m], j = column[m], k = row[n], l = column[n];
      const double A = (m == n ? mu : 0) + (mu - lambda * log(det)) * G[j][k] * G[l][i] + lambda * G[j][i] * G[l][k];
      d->K[size * m + n] = eta * A + slope * P[m] * P[n];
    }
  for (int m = 0; m < size; m++) d->s1.thermodynamic_forces[m] = eta * P[m];
  *d->s1.internal_state_variables = softer ? greatest : W;
  return 1;
}

static int elasticity(struct behaviour_data *d, int size) {
  const double E = d->s1.material_properties[0], nu = d->s1.material_properties[1];
  const double lambda = E * nu / ((1 + nu) * (1 - 2 * nu)), mu = E / (2 * (1 + nu));
  double *strain = d->s1.internal_state_variables;
  for (int m = 0; m < size; m++)
    strain[m] = d->s0.internal_state_variables[m] + d->s1.gradients[m] - d->s0.gradients[m];
  for (int m = 0; m < size; m++) {
    d->s1.thermodynamic_forces[m] = 2 * mu * strain[m] + (m < 3 ? lambda * (strain[0] + strain[1] + strain[2]) : 0);
    for (int n = 0; n < size; n++) d->K[size * m + n] = (m == n ? 2 * mu : 0) + (m < 3 && n < 3 ? lambda : 0);
  }
  return 1;
}

int SofteningNeoHooke_Tridimensional(struct behaviour_data *d) { return softening_neo_hooke(d, 9); }
int SofteningNeoHooke_PlaneStrain(struct behaviour_data *d) { return softening_neo_hooke(d, 5); }
int Elasticity_Tridimensional(struct behaviour_data *d) { return elasticity(d, 6); }
int Elasticity_PlaneStrain(struct behaviour_data *d) { return elasticity(d, 4); }
