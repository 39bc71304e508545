/* A behaviour with two elastic strains: each is a symmetric tensor that the caller rotates, and the stress is the mean of both stresses. */
#include "../../../examples/laws/like_mfront.c"

BEHAVIOUR(TwoStrains, 1, 1, "Strain", 1)
unsigned short TwoStrains_requiresStiffnessTensor = 1;
unsigned short TwoStrains_nMaterialProperties = 0;
const char *const *TwoStrains_MaterialProperties = 0;
unsigned short TwoStrains_nInternalStateVariables = 2;
const char *TwoStrains_InternalStateVariables[2] = {"FirstStrain", "SecondStrain"};
int TwoStrains_InternalStateVariablesTypes[2] = {1, 1};

static int two_strains(struct behaviour_data *d, int size) {
  struct behaviour_data second = *d;
  double stress[6];
  second.s0.internal_state_variables += size;
  second.s1.internal_state_variables += size;
  elasticity(&second, size);
  memcpy(stress, d->s1.thermodynamic_forces, size * sizeof(double));
  const int status = elasticity(d, size);
  for (int m = 0; m < size; m++) d->s1.thermodynamic_forces[m] = 0.5 * (d->s1.thermodynamic_forces[m] + stress[m]);
  return status;
}

int TwoStrains_Tridimensional(struct behaviour_data *d) { return two_strains(d, 6); }
int TwoStrains_PlaneStrain(struct behaviour_data *d) { return two_strains(d, 4); }
