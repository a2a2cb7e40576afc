/* The constant model: what a blob says, checked, as structures that point into it. */
#ifndef GK_MODEL_H
#define GK_MODEL_H
#include "base/gk_blob.h"
#include "base/gk_check.h"
#include "model/gk_ranges.h"

#define GK_PI 3.14159265358979323846
enum {
    MAX_ROTORS = GK_HIGH_ROTORS,
    MAX_GEARS = GK_HIGH_GEARS,
    MAX_ENGAGEMENTS = GK_HIGH_ENGAGEMENTS,
    MAX_PORTS = GK_HIGH_PORTS,
    MAX_SUPPORTS = GK_HIGH_SUPPORTS, /* directions */
    MAX_SENSORS = 255,               /* directions in which points of the housing are felt */
    MAX_SLICES = GK_HIGH_SLICES,
    MAX_FUNCTIONS = 8,
    LEADS = 33,       /* places across the face width where a lead is given */
    MAX_STARTS = 64,  /* parameters whose start is not the table's */
    MAX_CARRIED = 32, /* bodies in the axes of turning rotors */
    MAX_WHIRLS = 1000,
    MAX_MODES = 6000,
    MAX_TEETH = GK_HIGH_TEETH,
    MAX_GROUND = 2000,
    MAX_POINTS = 256, /* of a flank where rows are stored */
    MAX_LOW = 1000,   /* modes of nodal diameter 0 and 1 of a gear */
    MAX_OWN = 1000,   /* rigid motion and patterns of nodal diameter 0 and 1 of an observed gear */
    OFFSETS = 7,      /* tooth offsets −3 … 3 of the residual */
    SETS = 3,         /* of ground oscillators: as supported; with the supports held; without a housing */
    NAME_LENGTH = 32,
    MAX_NODES = GK_HIGH_NODES, /* of a flank along or across */
    MAX_FLANK_ROLLS = 1025,
    MAX_FLANK_PLACES = 129,
    SMEARED_ROLLS = 9, /* places of gk_gear.smeared */
    SMEARED_DISTANCES = 17
};

/* what the outputs tell of a gear's own motion; name NULL: nothing */
typedef struct gk_observed {
    const char *name;
    int from, own;                               /* its first amplitude among those of the model; rows of `rows` */
    const int32_t *own_number, *member, *number; /* (own), (own), (modes of the gear group) */
    double scale;
    const double *rows[SETS]; /* by set: (own, reads) */
} gk_observed;

/* what the flanks of a gear are beside their involutes */
typedef struct gk_field_of_flanks {
    int teeth, places, rolls; /* teeth 1: all alike; places 1: the same all across the width */
    const double *depth;      /* (teeth, 2 flanks, places, rolls) m, in the transverse section; NULL: nothing */
    double most;              /* the most that stands out, m */
} gk_field_of_flanks;

/* a toothed member */
typedef struct gk_gear {
    double r_b, s_form, s_tip, psi_b, phase;  /* phase: angle of tooth 0 when phi = 0 */
    double width, local, strip;               /* local = 2 (1 − ν²)/(π E); strip: half-width of the load strip */
    double relief, relief_start;              /* δ(s) = relief (s − relief_start)²₊ */
    double edge, corner_radius, corner_angle; /* tip edge: arc radius, polar position of its centre */
    double z_mid, helix;                      /* axial place of mid-width; base helix angle, right-hand positive */
    int rotor, z, modes;
    int points, low, mirrored; /* where rows are stored; modes of nodal diameter 0 and 1; flank 1 is the image of 0 */
    const double *smeared;     /* (rolls, distances, functions, functions) 1/m (gk_slices.c); NULL: not known */
    const double *smeared_tip; /* (distances, functions, functions) */
    int nodes[2];              /* of a flank for nodal contact: along, across; 0: none */
    const double *omega, *zeta;
    const double *resample;              /* (rolls, points) weights of the points on the even grid of rolls */
    const float *rows, *low_rows, *node; /* (2, points, functions, modes), (…, low); (3, 2, points, functions, 6) */
    const int32_t *low_member;           /* (low) 0 single, 1 first, 2 second of a pair */
    const double *node_support;          /* (6, supports) force on the gear's node by that of a support */
    const float *residual_own, *residual_next, *residual_across; /* gk_spread.c puts them together */
    const float *port_residual;
    const float *along_rows, *along_low, *along_normal, *along_own, *along_across; /* NULL: unknown */
    const double *turn_rate; /* (modes) Coriolis coupling of a pair; NULL: unknown */
    const int32_t *diameter, *member, *level_modes;
    const double *lead;  /* (2 flanks, LEADS) depth across the face width, in the transverse section; NULL: none */
    const double *index; /* (2 flanks, z) rad: individual index deviation of every tooth; NULL: none */
    double index_most;   /* the largest of them along the flank normal, m */
    gk_field_of_flanks flanks;
    const float *far_rows, *far_modes; /* patterns of far teeth (gk_far_fill.c); NULL: none */
    const double *runout; /* (4) axis of the toothing beside that of rotation: x, y, tilt about x, y; NULL: none */
    struct {
        int reads; /* ground oscillators that this gear reads */
        const int32_t *list;
        const double *centre, *low, *node; /* (6, reads); of the modes (low, reads); on the gear's node (6, reads) */
        const float *far;
    } ground[SETS];
    gk_observed observed;
} gk_gear;

typedef enum gk_mesh_kind { MESH_FLAT = 0, MESH_EXTERNAL = 1, MESH_INTERNAL = -1 } gk_mesh_kind;

typedef struct gk_engagement {
    char name[NAME_LENGTH];
    gk_mesh_kind kind;
    int gear[2];
    int shift[2];          /* B's tooth of A's tooth k: shift − k, in a ring shift + k, by flank */
    double position[2][2]; /* x, y of both gears */
    double direction;      /* from A to B, of a ring from it to A: teeth are placed and counted by it */
    double backlash, nominal_backlash, damping, force_max; /* backlash j_wt: of the pair; of the teeth as they are */
    double width;                                          /* common face width */
    double tilt[2];                                        /* of B's axis against A's, about x and y */
    double penalty, nodes_of_a; /* nodal contact, N/m³; share of A's nodes in it; penalty 0: there is none */
    double overlap_max;         /* teeth that overlap by more mean nothing */
} gk_engagement;

typedef enum gk_port_kind { PORT_SPRING, PORT_TORQUE, PORT_FIXED } gk_port_kind;

typedef struct gk_port {
    gk_port_kind kind;
    int rotor, chain; /* chain: its number among the chains + 1, 0: none */
    double k, c, inertia, disc, shaft_k, shaft_c;
    double play; /* of the port spring, between both sides, rad */
} gk_port;

/* ground oscillators of one set */
typedef struct gk_ground {
    int n, carrying; /* supports that carry: behind them the feet of a housing that is left out */
    const double *omega, *zeta, *rigid_share, *damper_rows, *damper, *support_rows, *support_compliance,
        *support_coupling, *kappa, *port_rows, *carried_rows, *whirl_rows, *sensor_rows;
} gk_ground;

struct gk_model {
    gk_blob blob;
    const char *name;
    const char *guid; /* of an FMU with this model */
    int starts;       /* parameters whose start is not the table's */
    const int32_t *start_reference;
    const double *start_value;
    int slices, rotors, gears, engagements, ports, supports, functions, rolls, sets, chains;
    int sensors;    /* directions of points of the housing */
    int housed;     /* a housing carries the bearings; it can be left out */
    int amplitudes; /* of observed gears, together */
    char rotor_name[MAX_ROTORS][NAME_LENGTH], support_name[MAX_SUPPORTS][NAME_LENGTH],
        displacement_name[MAX_SUPPORTS][NAME_LENGTH], sensor_name[MAX_SENSORS][NAME_LENGTH];
    int spatial; /* something moves along the axis or tilts, or the teeth are not the same all over the width */
    double cut[2], h_max, period_min;
    int degree[MAX_FUNCTIONS];
    double inertia[MAX_ROTORS]; /* of the spin; 0: the rotor stands */
    const int32_t
        *support_turn; /* (supports) 2 rotor, + 1 for the second of a pair, whose axes they are kept in; −1; NULL */
    int carried;       /* bodies that stand in the axes of a turning rotor */
    const int32_t *carried_frame; /* (carried) that rotor */
    const double *carried_place;  /* (carried, 2) place of their axes there times √m */
    int rubbing;                  /* all gears know displacement along the profile: friction is possible */
    int spinning;                 /* gyroscopic forces are known */
    int deviating, running_out;   /* some flanks are not nominal; some toothing does not run true */
    int whirls;                   /* pairs of rows of gyroscopic forces */
    const int32_t *whirl;         /* (whirls) rotor whose speed turns them */
    int frame[MAX_ROTORS];        /* rotor in whose axes this one stands and its supports rest, −1: the ground */
    gk_gear gear[MAX_GEARS];
    gk_engagement engagement[MAX_ENGAGEMENTS];
    gk_port port[MAX_PORTS];
    const double *port_residual, *port_support;
    gk_ground ground[SETS];
};

/* numbers of an engagement, a gear, a rotor of the model? For GK_ASSERT. */
static inline int gk_is_engagement(const gk_model *model, int e) { return e >= 0 && e < model->engagements; }
static inline int gk_is_gear(const gk_model *model, int g) { return g >= 0 && g < model->gears; }
static inline int gk_is_rotor(const gk_model *model, int r) { return r >= 0 && r < model->rotors; }

/* the frame of an engagement: both gears stand in it */
static inline int gk_frame_of(const gk_model *model, const gk_engagement *e)
{
    GK_ASSERT(e && gk_is_gear(model, e->gear[0]));
    return model->frame[model->gear[e->gear[0]].rotor];
}

/* the port of a rotor, −1: none */
static inline int gk_port_on(const gk_model *model, int rotor)
{
    GK_ASSERT(gk_is_rotor(model, rotor));
    for (int p = 0; p < model->ports; p++)
        if (model->port[p].rotor == rotor) return p;
    return -1;
}

/* the port that a gear's flanks feel through bodies: that of its own rotor, else that of its frame's; −1: none */
static inline int gk_port_of(const gk_model *model, int gear)
{
    GK_ASSERT(gk_is_gear(model, gear));
    const int rotor = model->gear[gear].rotor, own = gk_port_on(model, rotor);
    return own >= 0 || model->frame[rotor] < 0 ? own : gk_port_on(model, model->frame[rotor]);
}

/* r_bA + r_bB of an external engagement, r_bB − r_bA of an internal one */
static inline double gk_base_reach(const gk_model *model, const gk_engagement *e)
{
    GK_ASSERT(gk_is_gear(model, e->gear[0]) && gk_is_gear(model, e->gear[1]));
    return model->gear[e->gear[1]].r_b + (e->kind == MESH_INTERNAL ? -1.0 : 1.0) * model->gear[e->gear[0]].r_b;
}
#endif
