// A linearised step as plain arrays, for all dimensions. The files of `src/gpu` have structs with the same layout and
// names.

// Particles of a group.
#define LANES 8
// Groups that a thread block takes at a time: a thread for each particle.
#define TURN (THREADS / LANES)
// The widest tile of nodes along x that is summed at a time (`kernel.rs`).
#define WIDEST_TILE 6
// Calls a macro with the width of a tile as a constant.
#define WITH_WIDTH(width, call)    \
    switch (width) {               \
    case 1: call(1); break;        \
    case 2: call(2); break;        \
    case 3: call(3); break;        \
    case 4: call(4); break;        \
    case 5: call(5); break;        \
    default: call(6);              \
    }
// The forms of a tangent (`constitutive/tangents.rs`).
#define CLOSED 0
#define CLOSED_WITH_FACTORS 1
#define GENERAL 2
// Most sets of rows: the laws, and damping by the stiffness.
#define SETS 4

// The shape functions of all particles, block by block.
struct Transfer {
    // Of each block: its first group, its first node, its first place in `boxes` (one more entry at the end), and the size of its box.
    const u32 *group_first;
    const u32 *node_first;
    const u32 *box_first;
    const u32 *size;
    // Of each group: its first row of weights, the place of its first node in the box, its widths and lanes, a byte each, and its first particle.
    // Particles are numbered in the order of the passes.
    const u32 *weights_first;
    const u32 *window_first;
    const u32 *window_shape;
    const u32 *particle_first;
    // Rows of eight weights: for each group and axis N of all nodes, then N'.
    const double *weights;
    // Of each node of a block: its number, and its place in the box.
    const u32 *nodes;
    const u32 *places;
    // Of each node: the places of `boxes` that it adds, in the order of the blocks.
    const u32 *entry_first;
    const u32 *entries;
};

// The tangents of the particles in one form, times a factor. Averaged cells add a change of pressure times the tensor a.
struct Rows {
    const double *rows;
    double factor;
    // The cell of each particle by group and lane, and the change of pressure of each cell; none without averaged cells.
    const u32 *cells;
    const double *changes;
    int form;
    // The numbers of a particle, and the first of a.
    int count;
    int first_of_a;
};

// A pass over the particles (`pass.h`).
struct Pass {
    struct Transfer transfer;
    // The nodal field that is gathered, and the boxes of all blocks, into which the particles are summed.
    const double *u;
    double *boxes;
    // Groups whose rows are summed at a time, and the most rows and nodes of a window.
    int together;
    int window_rows;
    int window_nodes;
    // Whether particles give q, whether they give σ, and whether all weights are taken by their magnitudes.
    int values;
    int gradients;
    int magnitudes;
};

// The masses of the particles by group and lane, with a factor and 1 − ε; none without inertia or with a lumped mass.
struct Inertia {
    const double *mass;
    double factor;
    double consistent;
};

struct Product {
    struct Pass pass;
    struct Inertia inertia;
    int sets;
    struct Rows rows[SETS];
};

// Row i of the diagonal blocks of a product.
struct DiagonalBlocks {
    struct Product product;
    int i;
};

// The particles at the last grid reset, and the laws of their bodies, which are formulas (`material/formula.rs`).
struct Solids {
    // Of each group, a row of lanes each: H_r by rows, then V₀.
    const double *states;
    // The body of each particle by group and lane; the law of each body, and its two constants.
    const u32 *bodies;
    const u32 *laws;
    const double *constants;
    // Becomes 1 if a particle has det F ≤ 0.
    u32 *failed;
};

// The laws.
#define CIARLET 0
#define LOGARITHMIC 1

// J − 1 and J = m 2^k, with 2^−k and k ln 2. m is between √½ and √2.
struct Volume {
    double j;
    double jacobian;
    double scale;
    double k_ln_2;
    int k;
};

// The exponent of J, from the bits of J √2.
FUNCTION void binary_exponent(struct Volume *v) {
    union {
        double number;
        unsigned long long bits;
    } of = {v->jacobian * 1.4142135623730951};
    const int biased = (int)(of.bits >> 52);
    of.bits = (unsigned long long)(biased < 2046 ? 2046 - biased : 0) << 52;
    v->k = biased - 1023;
    v->scale = of.number;
    v->k_ln_2 = (double)v->k * 0.6931471805599453;
}

// The residual's part at the particles: stresses, and inertia.
struct Forces {
    struct Pass pass;
    struct Solids solids;
    // The masses with α₁ as the factor, and φ̂ at the particles, a row of lanes for each component of each group.
    struct Inertia inertia;
    const double *predicted;
};

// The laws linearised.
struct Linearize {
    struct Transfer transfer;
    const double *u;
    struct Solids solids;
    double *rows;
    int count;
};

// The changes of volume of the particles of averaged cells, b : L.
struct Volumes {
    struct Transfer transfer;
    const double *u;
    const double *rows;
    double *volumes;
    int count;
    int first_of_b;
};

// A nodal field at all particles, in the order of the passes. Each of them has `stride` numbers; the values begin at the number `first`, and the
// gradient follows by columns.
struct AtParticles {
    struct Transfer transfer;
    const double *u;
    double *results;
    int stride;
    int first;
    int gradient;
};

// Forces of all particles, in the order of the passes.
struct Spread {
    struct Pass pass;
    const double *forces;
    // Numbers of a force: the first components.
    int components;
};

struct Box {
    int size[3];
    int nodes;
};

FUNCTION struct Box box_of(const struct Transfer *a, u32 block) {
    struct Box box;
    box.nodes = 1;
    for (int k = 0; k < 3; k++) {
        box.size[k] = a->size[3 * block + k];
        box.nodes *= box.size[k];
    }
    return box;
}

// The window of a group in the box of its block, with the weights of one lane.
struct Window {
    int width[3];
    int lanes;
    // The first node, as a place in the box, and its index along each axis.
    int first;
    int place[3];
    // Nodes from one row of the box to the next, and from one plane to the next.
    int stride[2];
    // N along each axis; N' follows.
    const double *weights[3];
};

// So many bytes of shared memory are reserved for each group of a turn (`gpu/transfer.rs`).
typedef char window_has_64_bytes[sizeof(struct Window) == 64 ? 1 : -1];

FUNCTION int lanes_of(const struct Transfer *a, u32 group) { return a->window_shape[group] >> 24; }

FUNCTION struct Window window_of(const struct Transfer *a, const struct Box *box, u32 group, int lane, int dimension) {
    struct Window w;
    const u32 shape = a->window_shape[group];
    const double *weights = a->weights + (i64)a->weights_first[group] * LANES + lane;
    w.first = a->window_first[group];
    w.lanes = shape >> 24;
    w.stride[0] = box->size[0];
    w.stride[1] = box->size[0] * box->size[1];
    w.place[0] = w.first % w.stride[0];
    w.place[1] = w.first % w.stride[1] / w.stride[0];
    w.place[2] = w.first / w.stride[1];
    for (int k = 0; k < 3; k++) {
        w.width[k] = shape >> 8 * k & 255;
        w.weights[k] = weights;
        if (k < dimension) weights += 2 * w.width[k] * LANES;
    }
    return w;
}

// The width of the next tile if `left` nodes remain along x.
FUNCTION int tile(int left) {
    if (left <= WIDEST_TILE) return left;
    return left >= 2 * WIDEST_TILE - 2 ? WIDEST_TILE - 1 : (left + 1) / 2;
}

// The forces of surface points, and for each node the points that act on it, with weights.
struct PointSums {
    const u32 *first;
    const u32 *points;
    const double *weights;
    const double *forces;
};

// Contributions at the nodes.
struct NodalSums {
    // The boxes of all blocks; none without a pass over the particles.
    const double *boxes;
    // Values to which the sums are added; none for zeros.
    const double *start;
    // The lumped masses times their factor; none without inertia.
    const double *lumped;
    double lumped_factor;
    const double *u;
    // Whether a value is prescribed; none where values follow others: `clear_fixed` then clears them last.
    const u8 *prescribed;
    // Follower pressures, and contact.
    struct PointSums points[2];
};

struct Nodes {
    const u32 *entry_first;
    const u32 *entries;
    struct NodalSums sums;
    double *y;
    i64 n;
    int dimension;
};

// y at the nodes: the sum of all contributions.
KERNEL(add_boxes, Nodes) {
    PHASE(t) {
        const i64 i = ITEM(t);
        const struct NodalSums *of = &a.sums;
        if (i < a.n) {
            const i64 node = i / a.dimension, c = i % a.dimension;
            double sum = of->start ? of->start[i] : 0.0;
            if (of->lumped) sum += of->u[i] * (of->lumped_factor * of->lumped[node]);
            for (int s = 0; s < 2; s++) {
                const struct PointSums *points = &of->points[s];
                for (u32 k = points->first ? points->first[node] : 0; points->first && k < points->first[node + 1]; k++)
                    sum += points->forces[(i64)points->points[k] * a.dimension + c] * points->weights[k];
            }
            if (of->boxes)
                for (u32 e = a.entry_first[node]; e < a.entry_first[node + 1]; e++)
                    sum += of->boxes[(i64)a.entries[e] * a.dimension + c];
            a.y[i] = of->prescribed && of->prescribed[i] ? 0.0 : sum;
        }
    }
}

struct Followers {
    // The outer nodes, whether each of their components follows, and their rows of inner nodes with weights.
    const u32 *outer;
    const u8 *follows;
    const u32 *leader_first;
    const u32 *leaders;
    const double *leader_weights;
    i64 outer_count;
    // The same by inner node: its outer nodes, as places in the list, with weights.
    const u32 *inner;
    const u32 *follower_first;
    const u32 *followers;
    const double *follower_weights;
    i64 inner_count;
    // The nodal field, and a value for each component of an outer node.
    double *field;
    double *moved;
    int dimension;
};

// u = E û, in place.
KERNEL(extend, Followers) {
    PHASE(t) {
        const i64 i = ITEM(t), place = i / a.dimension, c = i % a.dimension;
        if (place < a.outer_count && a.follows[i]) {
            double sum = 0.0;
            for (u32 k = a.leader_first[place]; k < a.leader_first[place + 1]; k++)
                sum += a.field[(i64)a.leaders[k] * a.dimension + c] * a.leader_weights[k];
            a.field[(i64)a.outer[place] * a.dimension + c] = sum;
        }
    }
}

// The first half of R̂ = Eᵀ R: takes the forces from the components that follow.
KERNEL(take_followers, Followers) {
    PHASE(t) {
        const i64 i = ITEM(t), place = i / a.dimension, c = i % a.dimension;
        if (place < a.outer_count) {
            double *force = a.field + (i64)a.outer[place] * a.dimension + c;
            a.moved[i] = a.follows[i] ? *force : 0.0;
            if (a.follows[i]) *force = 0.0;
        }
    }
}

// The second half: gives them to the inner nodes.
KERNEL(give_leaders, Followers) {
    PHASE(t) {
        const i64 i = ITEM(t), place = i / a.dimension, c = i % a.dimension;
        if (place < a.inner_count) {
            double *force = a.field + (i64)a.inner[place] * a.dimension + c, sum = *force;
            for (u32 k = a.follower_first[place]; k < a.follower_first[place + 1]; k++)
                sum += a.moved[(i64)a.followers[k] * a.dimension + c] * a.follower_weights[k];
            *force = sum;
        }
    }
}

struct Fixed {
    const u8 *fixed;
    double *field;
    i64 n;
};

// Sets the fixed values to zero.
KERNEL(clear_fixed, Fixed) {
    PHASE(t) {
        const i64 i = ITEM(t);
        if (i < a.n && a.fixed[i]) a.field[i] = 0.0;
    }
}
