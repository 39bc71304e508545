// The linearised forces of surface points (`mechanics/linearized/pressure.rs` and `contact.rs`), and the pressures of averaged cells.

// Components of the motion of a free obstacle.
#define MOTION 6

struct Points {
    // Of each point: the nodes that move it, with weights, and for a pressure a block of each node, column by column.
    const u32 *first;
    const u32 *nodes;
    const double *weights;
    const double *blocks;
    // For contact: the tangent of each point, column by column, and the free obstacle that it touches.
    const double *tangents;
    const u32 *on_free;
    // ∂f/∂q and ∂q/∂x of each point, column by column, and δq of each free obstacle; none without free obstacles.
    const double *of_motion;
    const double *motion;
    double *motions;
    i64 obstacles;
    const double *u;
    double *forces;
    i64 n;
    int dimension;
};

// Σ n u of a point
FUNCTION void moved(const struct Points *a, i64 point, double *x) {
    for (int c = 0; c < a->dimension; c++) x[c] = 0.0;
    for (u32 e = a->first[point]; e < a->first[point + 1]; e++)
        for (int c = 0; c < a->dimension; c++) x[c] += a->u[(i64)a->nodes[e] * a->dimension + c] * a->weights[e];
}

// Row i of a matrix with `rows` rows, stored column by column, times x.
FUNCTION double row_product(const double *matrix, int rows, int columns, int i, const double *x) {
    double sum = matrix[i] * x[0];
    for (int k = 1; k < columns; k++) sum += matrix[k * rows + i] * x[k];
    return sum;
}

// δq of the free obstacles: the sum over their points, in order.
KERNEL(point_motions, Points) {
    PHASE(t) {
        const i64 item = ITEM(t), obstacle = item / MOTION;
        const int k = (int)(item % MOTION), d = a.dimension;
        if (obstacle < a.obstacles) {
            double sum = 0.0;
            for (i64 point = 0; point < a.n; point++) {
                if (a.on_free[point] != obstacle) continue;
                double x[3] = {0.0, 0.0, 0.0};
                moved(&a, point, x);
                sum += row_product(a.motion + point * MOTION * d, MOTION, d, k, x);
            }
            a.motions[item] = sum;
        }
    }
}

// The changes of the forces of all points.
KERNEL(point_forces, Points) {
    PHASE(t) {
        const i64 point = ITEM(t);
        const int d = a.dimension;
        if (point < a.n) {
            double *force = a.forces + point * d;
            if (a.blocks) {
                for (int i = 0; i < d; i++) force[i] = 0.0;
                for (u32 e = a.first[point]; e < a.first[point + 1]; e++)
                    for (int i = 0; i < d; i++)
                        force[i] += row_product(a.blocks + (i64)e * d * d, d, d, i, a.u + (i64)a.nodes[e] * d);
            } else {
                double x[3] = {0.0, 0.0, 0.0};
                moved(&a, point, x);
                for (int i = 0; i < d; i++) {
                    double sum = row_product(a.tangents + point * d * d, d, d, i, x);
                    if (a.motions && a.on_free[point] != NONE)
                        sum -= row_product(a.of_motion + point * MOTION * d, d, MOTION, i, a.motions + a.on_free[point] * MOTION);
                    force[i] = sum;
                }
            }
        }
    }
}

struct Cells {
    // Of each cell: its particles by group and lane, and its stiffness.
    const u32 *first;
    const u32 *members;
    const double *stiffness;
    const double *volumes;
    double *changes;
    i64 n;
};

// δp = k Σ b : L of every cell.
KERNEL(cell_pressures, Cells) {
    PHASE(t) {
        const i64 cell = ITEM(t);
        if (cell < a.n) {
            double sum = 0.0;
            for (u32 k = a.first[cell]; k < a.first[cell + 1]; k++) sum += a.volumes[a.members[k]];
            a.changes[cell] = a.stiffness[cell] * sum;
        }
    }
}
