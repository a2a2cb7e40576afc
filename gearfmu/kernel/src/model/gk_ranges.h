/* The ranges of the numbers that both the kernel and a stage file limit, in SI. The kernel checks the model blob and
 * its variables against them; Python reads this file (gearfmu/quantities.py) and adds unit and remedy. */
#ifndef GK_RANGES_H
#define GK_RANGES_H

/* counts: they decide how much memory a model can need */
#define GK_LOW_SLICES 1
#define GK_HIGH_SLICES 20
#define GK_LOW_ROTORS 1
#define GK_HIGH_ROTORS 24
#define GK_LOW_GEARS 0
#define GK_HIGH_GEARS 16
#define GK_LOW_ENGAGEMENTS 0
#define GK_HIGH_ENGAGEMENTS 12
#define GK_LOW_PORTS 0
#define GK_HIGH_PORTS 16
#define GK_LOW_SUPPORTS 0 /* directions in which bodies are held */
#define GK_HIGH_SUPPORTS 256
#define GK_LOW_TEETH 1
#define GK_HIGH_TEETH 1000
#define GK_USUAL_H 1e-4 /* s: communication step of a model description */
#define GK_LOW_NODES 2  /* of a flank, along or across */
#define GK_HIGH_NODES 513

/* gears: m, but for the relief's curvature, 1/m */
#define GK_LOW_BASE_RADIUS 1e-4
#define GK_HIGH_BASE_RADIUS 10
#define GK_LOW_FACE_WIDTH 1e-6
#define GK_HIGH_FACE_WIDTH 10
#define GK_LOW_STRIP 1e-6 /* half-width of the load strip */
#define GK_HIGH_STRIP 0.1
#define GK_LOW_TIP_EDGE 1e-6
#define GK_HIGH_TIP_EDGE 0.1
#define GK_LOW_PLACE -10 /* along the axis */
#define GK_HIGH_PLACE 10
#define GK_LOW_AXIS -100 /* x or y of an axis */
#define GK_HIGH_AXIS 100
#define GK_LOW_RELIEF 0
#define GK_HIGH_RELIEF 1e7
#define GK_LOW_FLANK_DEPTH -1e-2
#define GK_HIGH_FLANK_DEPTH 1e-2
#define GK_LOW_RUNOUT -1e-2 /* m, and rad */
#define GK_HIGH_RUNOUT 1e-2
#define GK_LOW_TILT -0.01 /* rad, of an axis against that of its mate */
#define GK_HIGH_TILT 0.01
#define GK_LOW_DAMPING_RATIO 0 /* of elastic modes */
#define GK_HIGH_DAMPING_RATIO 0.9

/* engagements */
#define GK_LOW_BACKLASH -1e-3 /* m */
#define GK_HIGH_BACKLASH 1e-2
#define GK_LOW_CONTACT_DAMPING 0 /* N·s/m² */
#define GK_HIGH_CONTACT_DAMPING 1e9
#define GK_LOW_PENALTY 1e6 /* N/m³ */
#define GK_HIGH_PENALTY 1e22
#define GK_LOW_FRICTION 0
#define GK_HIGH_FRICTION 0.5
#define GK_LOW_VISCOSITY 1e-4 /* Pa·s */
#define GK_HIGH_VISCOSITY 10
#define GK_LOW_ROUGHNESS 1e-9 /* m */
#define GK_HIGH_ROUGHNESS 1e-5
#define GK_LOW_FILM_ROUGHNESS 1e-8 /* m */
#define GK_HIGH_FILM_ROUGHNESS 1e-5
#define GK_FILM_REACH 100e-6 /* m: open flanks further apart than this know no film (assumed) */

/* ports and what happens to them */
#define GK_LOW_PORT_STIFFNESS 1e-6 /* N·m/rad */
#define GK_HIGH_PORT_STIFFNESS 1e15
#define GK_LOW_PORT_DAMPING 0 /* N·m·s/rad */
#define GK_HIGH_PORT_DAMPING 1e12
#define GK_LOW_INERTIA 1e-12 /* kg·m² */
#define GK_HIGH_INERTIA 1e7
#define GK_LOW_TORQUE -1e9 /* N·m */
#define GK_HIGH_TORQUE 1e9
#define GK_LOW_CAPACITY 0 /* N·m */
#define GK_HIGH_CAPACITY 1e9
#define GK_LOW_SPEED -1e5 /* rad/s */
#define GK_HIGH_SPEED 1e5

/* time */
#define GK_LOW_CUT 1 /* Hz */
#define GK_HIGH_CUT 1e9
/* Oscillators below this share of the cut of level fast by which engagements of one gear feel each other (the ovals of
 * a ring between planets) are dynamic at every level: far teeth (gk_far_fill.c) know those above it alone. */
#define GK_SHARED_BELOW 0.25
#define GK_LOW_STEP 0 /* s; 0: the default of model and level */
#define GK_HIGH_STEP 1e-3

#endif
