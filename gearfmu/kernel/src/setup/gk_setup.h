/* What is fixed once level, effects and step are chosen: dynamic oscillators, tables of rows and of compliance along
 * the path of contact, coefficients of the joints. */
#ifndef GK_SETUP_H
#define GK_SETUP_H
#include "base/gk_check.h"
#include "base/gk_math.h"
#include "model/gk_data.h"
#include "model/gk_effects.h"
#include "setup/gk_grid.h"
#include "setup/gk_room.h"
#include "setup/gk_spread.h"

enum {
    NODES = 88,           /* of a side's table in one pitch */
    OSCILLATOR_STATE = 4, /* q, v, f, f_rate */
    GAMMAS = 25,          /* γ is known at h·2^(−i/4) */
    MAX_CANDIDATES = 24,  /* tooth pairs that can be near contact at any position, both flanks */
    GAPS = 4,             /* places along a part of a line of contact at which its gap is known */
    MAX_BLOCK = MAX_SLICES * MAX_SLICES,
    FIRST_PATTERN = 8, /* of a gear's patterns on the ground group: rigid motions and ports come before */
    FAR = 12,          /* patterns by which engagements of one gear feel each other */
    MAX_SOFT = 64      /* modes of a gear with several engagements that statics take as unknowns */
};

#define GK_LANES(setup, g) (GK_HAS(modes) && GK_HAS(elastic) ? (setup)->modal[g].n : 0)
#define GK_STRIPS(of) (GK_HAS(slices) ? (of)->strips : 1)

typedef struct gk_modal { /* dynamic modes of a gear group: n lanes, [first members | second members], padded with 0 */
    int n, pairs, count;
    size_t at;            /* where its state begins behind the ground group's */
    double *omega, *zeta; /* (n) */
    gk_real *omega2;
    int32_t *lane;          /* (count) lane of every dynamic mode */
    gk_real *cosine, *sine; /* (z, pairs) */
    int turns;              /* so many pairs are coupled by Coriolis forces; 0 where the effect is off or unknown */
    gk_real *turn_rate;     /* (pairs) */
} gk_modal;

/* of a pose among the rows of a gear's rigid motion */
static const int GK_RIGID_ROW[SPACE] = {0, 1, 5, 2, 3, 4};

typedef struct gk_span { /* the part of a row that is not zero, quads-aligned */
    int from, width;
} gk_span;

typedef struct gk_base { /* dynamic oscillators of the ground group: rotor by rotor, each padded to quads */
    int set, n, count;
    int32_t *which; /* (n) their numbers in the model, −1: padding */
    int32_t *slot;  /* (all ground oscillators of the set) place among the dynamic ones, −1: not dynamic */
    double *omega, *zeta, *omega2; /* (n), 0 in padding */
    double *damper_rows;           /* (supports, n) elongation of a support's own spring */
    double *support_rows;          /* (supports, n): force on the support, kappa included */
    double *support_damping;       /* (supports, n): force on it by the dashpots of all supports per speed */
    double *port_rows;             /* (ports, n) */
    double *sensor_rows;           /* (sensors, n) */
    double *carried_rows;          /* (2 carried, n) √m x, √m y of carried bodies */
    int turns;                     /* pairs of rows x, y that turn into each other: carried bodies, gyroscopic forces */
    int32_t *turn_rotor;           /* (turns) with whose speed */
    double *turn_rows;             /* (2 turns, n) */
    gk_span *turn_span;            /* (turns) the part of both that is not zero */
    gk_span crowd;                 /* oscillators that many pairs turn; width 0: none */
    int crowd_pairs, crowd_dampers; /* that have just these */
    double *outward;                /* (rotors, n) centrifugal force on what a rotor carries per square of its speed */
    double *outward_support;        /* (rotors, supports) what it does at once to the forces on supports */
    double *centre[MAX_GEARS];      /* (6, n): rigid motion of every gear at its mid-width */
    const double *moved[MAX_GEARS][SPACE];            /* the same as in a pose, from the part on that the gear reads */
    int motions[MAX_GEARS], motion[MAX_GEARS][SPACE]; /* those that are not zero */
    gk_span damper_span[MAX_SUPPORTS], support_span[MAX_SUPPORTS], support_damping_span[MAX_SUPPORTS],
        port_span[MAX_PORTS], sensor_span[MAX_SENSORS];
    int from[MAX_GEARS], width[MAX_GEARS]; /* quads-aligned part that a gear reads */
    int patterns[MAX_GEARS];               /* in which its flanks feel that part, 0: oscillator by oscillator */
    double *pattern[MAX_GEARS];            /* (patterns, width) rigid motions as in a pose, ports, flanks */
    gk_real *flanks[MAX_GEARS];            /* those of flanks, in whole halves: the same numbers */
    int port_slot[MAX_GEARS][MAX_PORTS];   /* a port's place among them, −1: none */
} gk_base;
/* is it a turning pair or a dashpot of the crowd, by its span? */
static inline int gk_in_crowd(const gk_base *base, gk_span span)
{
    return base->crowd.width && span.from == base->crowd.from && span.width == base->crowd.width;
}

/* What a side knows of displacement and force along the profile (docs/theory.md, 2.8), for friction. Everything is
 * against the direction in which gear A slides past B, so that rows stand beside those of the normal displacement. */
typedef struct gk_along {
    gk_real *rows;   /* as those of the side */
    double *ground;  /* as those of the side */
    gk_real *normal; /* (nodes + 1, points, columns): what is not dynamic yields along the normal at a point (first) per
                        force along the profile at another */
    gk_real *own;    /* the same along the profile */
    double *support; /* as that of the side, over all supports */
} gk_along;

/* One gear of an engagement on its side: rows and compliances of its candidates (teeth that may touch), at NODES + 1
 * positions of the gear in one pitch, for the reference tooth 0; for another reference tooth the gear group's state is
 * turned, not the rows. Between two nodes rows are linear. */
typedef struct gk_side {
    int gear, which;         /* which: 0 for A, 1 for B */
    int nodes;               /* positions − 1 */
    int first[2], count[2];  /* candidates of drive and coast flank: tooth offsets first, first + step … */
    int step;                /* +1 or −1, so that candidates follow each other as the teeth of gear A do */
    int candidates, columns; /* columns: points of all candidates, padded so that quads may be read from any of them */
    double both;             /* sum of the lengths of roll of both flanks of one tooth */
    double pitch;            /* base pitch */
    gk_real *rows;           /* (nodes + 1, candidates, strips, n) */
    double *ground;          /* (nodes + 1, points, width of the gear): what ground oscillators displace outward, beside
                               rigid motion, at the nominal place of contact */
    gk_real
        *residual;  /* (nodes + 1, points, 2, columns): C of what is not dynamic, at the node and mixed with the next:
                          all of C is a parabola between nodes at every level; points: strips of the candidates */
    double *path;   /* (nodes + 1, candidates, strips²): residual of a tooth beyond all stored modes */
    int port_of;    /* the port that the gear feels, −1: none */
    double *port;   /* (nodes + 1, candidates, strips): residual between flank and bore angle */
    double *far;    /* (nodes + 1, points, FAR): patterns of far teeth */
    double *shares; /* (nodes + 1, points, patterns − FIRST_PATTERN): `ground` by patterns */
    gk_along along;
    gk_span held;    /* the supports that this side loads */
    double *support; /* (nodes + 1, candidates, strips, those in whole quads): force on them beside the oscillators' */
} gk_side;

typedef struct gk_line {              /* of contact of a tooth pair, z (m) in the engagement's width */
    double end[2], edge[2], moves[2]; /* its ends; tip edges; ends that move with a face: 1, at a tip edge: 0 */
    double missing; /* of the least length, 0 … 1: the pair has left its flanks, or is about to reach them */
} gk_line;

typedef struct gk_part { /* of a line of contact, or a slice of the width; z (m) */
    double end[2], middle, moves;
    double flank; /* its place on both flanks that is nearest to its middle, else the one next to them */
} gk_part;

typedef enum gk_friction_law { FRICTION_CONSTANT, FRICTION_BENEDICT_KELLEY, FRICTION_ISO_TR_14179 } gk_friction_law;

typedef struct gk_friction { /* of an engagement */
    gk_friction_law law;
    double coefficient, viscosity, roughness;
    double sliding;              /* largest sliding speed on the path of contact per speed of gear A, m */
    double pitch_sum, pitch_rho; /* at the pitch point: sum of the rolling speeds per speed of gear A, m; reduced radius
                                    of curvature in the normal section, m */
} gk_friction;

typedef struct gk_sliding { /* of a contact, at the moment */
    double load;            /* normal force per metre of the line of contact */
    double total;           /* normal force of the engagement */
    double slides, rolls;   /* sliding speed; sum of the rolling speeds of both flanks */
    double turns;           /* speed of gear A */
} gk_sliding;

typedef struct gk_mesh { /* an engagement */
    int index, island;   /* island: engagements that share rotors have one number */
    int coupled;         /* its island has others */
    gk_side side[2];
    gk_span part[2];      /* parts of the ground group that its rows read: gear A's, gear B's; one where these meet */
    int local;            /* their widths together */
    int at[2];            /* where the part of either gear begins in such a row */
    int joined;           /* both gears read the same oscillators: what a step does has no tables */
    int ports, port[2];   /* ports whose rows stand in this engagement's system */
    int spins, spin[7];   /* spins that its rows read: rotor of A, of B, of their frame, chains' inertias and discs */
    int frame;            /* rotor of the frame, −1: the ground */
    int joint_spin[2][2]; /* inertia and disc of its ports among them, −1: none */
    gk_friction friction;
    double film_cut;  /* roughness: what is added to every gap of the squeeze film, m */
    double action[2]; /* t of the line of action of both flanks at the nominal axes (gk_flank.c) */
    double clearance, clearance_slope, distance; /* gaps of both flanks together at the nominal centre distance */
    int coasts;                                  /* its flanks sg = −1 are those that carry (gk_kinematics_carrying) */
    double allowance, damping;     /* what opens the coast flanks beyond the teeth's own numbers, along the normal */
    double helix[2], cosine, sine; /* tangents of both base helix angles; cosine of them, sine of A's */
    double past[2];                /* length of roll (m) past the end of a flank on which its tip edge carries */
    double lead[2][MAX_SLICES];    /* what leads open at a strip, by flank, in the transverse section */
    gk_deviation deviation[2];     /* of gear A and of gear B, by strip */
    double protrusion;             /* what places of teeth and flanks may close of a gap, m */
    int runs_out;                  /* a toothing does not run true */
    int rides;     /* strips are parts of the line of contact and move with it, not slices of the width */
    double yields; /* 1/k: what a part yields more, before all of it has closed (gk_law.c), m²/N */
    double strip_width[MAX_SLICES], strip_middle[MAX_SLICES], strip_term, square_low, square_high, log_low,
        log_high;                               /* bounds of b² in the local law, and their ln */
    gk_nodes nodes[2];                          /* nodal contact: of gear A and of gear B */
    double penalty[2], compliance, retardation; /* N/m³ of the nodes of A and of B; m²/N of a line; s, damper force over
                                                   elastic force and rate */
} gk_mesh;

typedef struct gk_joint {
    int live;
    double compliance, damping; /* 1/k, c */
} gk_joint;

/* what an integrator is: the one place where they differ in more than their own file */
typedef struct gk_scheme {
    int is_explicit; /* forces follow from positions; limited by stability; no account of work; knows no clutch */
    int corrected;   /* γ > 0: corrected for time within the step */
} gk_scheme;
static inline const gk_scheme *gk_scheme_of(gk_integrator integrator)
{
    GK_ASSERT(integrator >= DG4 && integrator <= CENTRAL);
    static const gk_scheme schemes[] = {
        [DG4] = {.corrected = 1}, [EM] = {0}, [RK45] = {.is_explicit = 1}, [CENTRAL] = {.is_explicit = 1}};
    return &schemes[integrator];
}

typedef struct gk_tally gk_tally;
typedef void gk_tally_function(const gk_model *model, const gk_setup *setup, const gk_work *work, gk_data *data,
                               double h, gk_tally *tally);
typedef void gk_supports_function(const gk_model *model, const gk_setup *setup, const double *moved,
                                  const double *speed, double *out);
typedef void gk_moves_function(const gk_model *model, const gk_setup *setup, gk_room *room, const gk_coefficients *k);
typedef int gk_holds_function(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data,
                              const gk_coefficients *k, double mu);
typedef void gk_keep_function(const gk_model *model, const gk_setup *setup, gk_work *work, const gk_data *data);
typedef gk_outcome gk_step_function(const gk_model *model, const gk_setup *setup, gk_work *work, gk_data *data,
                                    double h, double gamma);

struct gk_setup {
    uint64_t magic;
    gk_level level;
    gk_integrator integrator;
    gk_effects on;
    double highest; /* ω up to which oscillators are dynamic at level full, rad/s */
    int slices;
    int nodal;   /* contact by nodes and penalty, else by lines */
    int spatial; /* axial motion and tilt count, every strip has its own gap; else those of a tooth pair share one */
    int engagements_of[MAX_GEARS];
    int strips; /* contact rows of a tooth pair: slices, or half of them where both halves of the width do the same */
    int spins;
    double h, gamma_at[GAMMAS];
    double inverse_inertia[MAX_SPINS];
    gk_joint joint[MAX_PORTS][JOINTS];
    int chained[MAX_PORTS];      /* inertia, clutch and shaft lie between port and bore */
    int given_torque[MAX_PORTS]; /* the port's row carries a given torque */
    int clutches;
    double port_own[MAX_PORTS]; /* residual of the bore angle */
    double port_support[MAX_PORTS]
                       [MAX_SUPPORTS]; /* force on a support per unit moment at a port, beside the oscillators' */
    gk_modal modal[MAX_GEARS];
    gk_flank_tables flank[MAX_GEARS];
    gk_real *far[MAX_GEARS]; /* (z, FAR, LANES): what the patterns on a tooth displace by a load so many teeth before */
    int far_on[MAX_GEARS];   /* the gear has several engagements, and something in it is not dynamic */
    gk_base base;
    gk_mesh mesh[MAX_ENGAGEMENTS];
    int islands;
    gk_point_rows point_rows[MAX_GEARS]; /* nodal contact */
    gk_step_function *step;              /* of the integrator, in the widest vectors of this processor */
    gk_tally_function *count;            /* what is summed after every step, likewise */
    gk_moves_function *moves;            /* tables of a step's length, likewise */
    gk_supports_function *supports;      /* forces on supports by motion, likewise */
    gk_keep_function *keep;              /* the limit of the step (integrate/gk_closed.c), likewise */
    gk_holds_function *holds;
    size_t amplitudes; /* their place in the data, in doubles from the first oscillator on */
    size_t state_size;
};

#define GK_SETUP_MAGIC 0x32505445534b47ULL
typedef double gk_strip_weights[MAX_SLICES][MAX_FUNCTIONS];

/* For GK_ASSERT: the number of an engagement that has been planned; a span of whole quads */
static inline int gk_is_mesh(const gk_setup *setup, int e)
{
    return e >= 0 && e < MAX_ENGAGEMENTS && setup->mesh[e].index == e && setup->mesh[e].spins > 0;
}
static inline int gk_span_is_whole(gk_span span) { return span.from >= 0 && span.from % 4 == 0 && span.width % 4 == 0; }

/* do two gears read the same oscillators, both by patterns? */
static inline int gk_patterns_meet(const gk_base *base, int a, int b)
{
    return base->patterns[a] && base->patterns[b] && base->from[a] == base->from[b];
}

/* states in gk_data */
static inline double *gk_ground_of(gk_data *data) { return GK_OF(data, oscillator); }
static inline gk_real *gk_modal_of(const gk_setup *setup, gk_data *data, int g)
{
    GK_ASSERT(g >= 0 && g < MAX_GEARS);
    return (gk_real *)(GK_OF(data, oscillator) + OSCILLATOR_STATE * setup->base.n) + setup->modal[g].at;
}
static inline const double *gk_ground_seen(const gk_data *data) { return GK_OF(data, oscillator); }
static inline const gk_real *gk_modal_seen(const gk_setup *setup, const gk_data *data, int g)
{
    GK_ASSERT(g >= 0 && g < MAX_GEARS);
    return (const gk_real *)(GK_OF(data, oscillator) + OSCILLATOR_STATE * setup->base.n) + setup->modal[g].at;
}
/* kinetic energy of a spin */
static inline double gk_kinetic(const gk_setup *setup, int d, double speed)
{
    GK_ASSERT(d >= 0 && d < setup->spins);
    return setup->inverse_inertia[d] > 0.0 ? 0.5 * speed * speed / setup->inverse_inertia[d] : 0.0;
}
/* numbers of the spins of a port's chain */
static inline int gk_inertia_of(const gk_model *model, int port)
{
    GK_ASSERT(port >= 0 && port < model->ports && model->port[port].chain > 0);
    return model->rotors + 2 * model->port[port].chain - 2;
}
static inline int gk_disc_of(const gk_model *model, int port)
{
    GK_ASSERT(port >= 0 && port < model->ports && model->port[port].chain > 0);
    return model->rotors + 2 * model->port[port].chain - 1;
}

/* gk_setup.c; which: the dynamic ground oscillators */
void gk_setup_fill(const gk_model *model, gk_setup *setup, gk_room *room, const gk_data *data, const int32_t *which);
/* gk_far_fill.c */
int gk_far_known(const gk_model *model, const gk_setup *setup, int g);
void gk_far_fill(const gk_model *model, gk_setup *setup, int g);
/* gk_nodal_setup.c */
void gk_nodal_rows(const gk_model *model, gk_setup *setup, int g);
void gk_nodal_fill(const gk_model *model, const gk_setup *setup, const gk_data *data, gk_mesh *mesh);
/* gk_strips.c */
int gk_strips_mirrored(const gk_model *model);
double gk_strips_lead(const gk_gear *gear, int flank, double x);
/* gk_deviation.c: `from` and `to` (lines), −1 … 1 of the gear's half-width: the part of it that a line is the mean of;
 * the same array: the place itself */
size_t gk_deviation_size(const gk_gear *gear, int lines);
void gk_deviation_fill(const gk_setup *setup, const gk_gear *gear, int lines, const double *from, const double *to,
                       gk_deviation *d);
/* the field itself: its lines are its places across the width */
void gk_deviation_share(const gk_setup *setup, const gk_gear *gear, gk_deviation *d);
/* depth along the roll of a flank, NULL: an involute; its value (m) and slope at a length of roll, straight beyond the
 * ends of the flank */
const double *gk_deviation_line(const gk_deviation *d, int tooth, int flank, int line);
double gk_deviation_at(const gk_gear *gear, const double *line, double roll, double *slope);
/* moves both gears of a pose to where their toothings stand; turn (POSE): derivatives by the gear's own angle; 0 where
 * all run true. What follows for a gradient by the pose as it was, and for a motion of the pose. */
int gk_runout_move(const gk_model *model, const gk_setup *setup, const gk_engagement *e, double *pose, double *turn);
void gk_runout_turn(const double *turn, double *gradient);
void gk_runout_follow(const double *turn, double *motion);
int gk_strips_count(const gk_model *model, int slices);
void gk_strips_fill(const gk_model *model, const gk_setup *setup, gk_mesh *mesh);
gk_line gk_strips_line(const gk_model *model, const gk_mesh *mesh, double sg, const double roll[2]);
gk_part gk_strips_part(const gk_setup *setup, const gk_line *line, int strip);
void gk_strips_spread(const gk_setup *setup, const gk_engagement *e, const double end[2], double force, double *slice);
void gk_strips_row(const gk_model *model, int g, double from, double to, double *out);
/* entries of whole quads that hold n */
static inline int gk_padded(int n)
{
    GK_ASSERT(n >= 0);
    return (n + 3) / 4 * 4;
}
static inline int gk_directions(const gk_setup *setup) { return setup->spatial ? SPACE : PLANE; }
/* motions of a gear and the angle of its bore that a model knows */
static inline int gk_common(const gk_setup *setup) { return setup->spatial ? COMMON : COMMON / 2; }
/* Σ of a row over its span, and its multiple added there */
static inline double gk_dot_span(gk_span span, const double *row, const double *x)
{
    GK_ASSERT(gk_span_is_whole(span));
    return gk_dot_quads(row + span.from, x + span.from, span.width / 4);
}
static inline void gk_axpy_span(gk_span span, double f, const double *row, double *y)
{
    GK_ASSERT(gk_span_is_whole(span));
    gk_axpy(f, row, y, span.from / 4, (span.from + span.width) / 4);
}
/* the parts of a vector of the ground group that an engagement reads */
static inline void gk_local_gather(const gk_mesh *mesh, const double *x, double *row)
{
    GK_ASSERT(mesh->part[0].width + mesh->part[1].width == mesh->local);
    memcpy(row, x + mesh->part[0].from, (size_t)mesh->part[0].width * sizeof *row);
    memcpy(row + mesh->part[0].width, x + mesh->part[1].from, (size_t)mesh->part[1].width * sizeof *row);
}
/* gk_lubrication.c */
void gk_lubrication_fill(const gk_model *model, const gk_data *data, gk_mesh *mesh);
double gk_lubrication_most(const gk_friction *friction);
double gk_lubrication_coefficient(const gk_friction *friction, double width, const gk_sliding *at);
void gk_strips_rows(const gk_model *model, const gk_setup *setup, const gk_engagement *e, int g, gk_strip_weights out);
#endif
