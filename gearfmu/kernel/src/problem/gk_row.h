/* Kinds of rows (problem/gk_row_*.c, one file a kind). A problem is a list of blocks: rows of one kind that follow each
 * other, the contacts first. A kind has verbs, here, and traits (gk_system.h). A new kind is a new file, its line below
 * and its traits, and a place where such a row is listed. */
#ifndef GK_ROW_H
#define GK_ROW_H
#include "base/gk_lanes.h"
#include "gk.h"
#include "model/gk_data.h"
#include "model/gk_model.h"
#include "problem/gk_system.h"
#include "problem/gk_work.h"
#include "setup/gk_setup.h"

typedef struct gk_forming { /* an engagement whose problem is formed */
    const gk_model *model;
    const gk_setup *setup;
    const gk_data *data;
    gk_work *work;
    int e;
} gk_forming;

typedef struct gk_row_verbs { /* NULL: nothing is left to do */
    /* what a row remembers, beside the force, and the damper's force, of the last step */
    void (*recall)(const gk_forming *f, gk_system *s, int i);
    /* gaps at the predicted state: adds what is not of the oscillators; derivatives by the spins */
    void (*read)(const gk_forming *f, double h, gk_system *s, const gk_row_block *b);
    /* gap at the start, and the first guess of status; returns whether forces are not those of the last step */
    int (*begin)(const gk_forming *f, gk_system *s, const gk_row_block *b);
    /* marks the rows that contradict their status, returns how many; changes the status of one */
    int (*contradict)(const gk_system *s, const gk_row_block *b, unsigned char *wrong);
    void (*flip)(gk_system *s, int i);
    /* of a joint with two ends: how far its outer end is ahead of the inner one, at the end of the step */
    double (*twist)(const gk_setup *setup, const gk_system *s, int i);
    /* remembers the end of the step */
    void (*keep)(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b);
} gk_row_verbs;

/* gk_row_contact.c */
GK_HOT void gk_row_contact_list(const gk_forming *f, double h, gk_system *s);
GK_HOT void gk_row_contact_read(const gk_forming *f, double h, gk_system *s, const gk_row_block *b);
GK_HOT int gk_row_contact_begin(const gk_forming *f, gk_system *s, const gk_row_block *b);
GK_HOT int gk_row_contact_contradict(const gk_system *s, const gk_row_block *b, unsigned char *wrong);
GK_HOT void gk_row_contact_flip(gk_system *s, int i);
GK_HOT void gk_row_contact_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b);
/* gk_row_joint.c: springs and given torques; what all joints have in common */
GK_HOT void gk_row_joint_list(const gk_forming *f, double h, gk_system *s);
GK_HOT double gk_row_joint_reading(const gk_forming *f, gk_system *s, int i, const double *spin);
GK_HOT void gk_row_joint_read(const gk_forming *f, double h, gk_system *s, const gk_row_block *b);
GK_HOT int gk_row_joint_begin(const gk_forming *f, gk_system *s, const gk_row_block *b);
GK_HOT double gk_row_joint_twist(const gk_setup *setup, const gk_system *s, int i);
GK_HOT int gk_row_joint_begin_given(const gk_forming *f, gk_system *s, const gk_row_block *b);
GK_HOT void gk_row_joint_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b);
/* gk_row_play.c */
GK_HOT void gk_row_play_recall(const gk_forming *f, gk_system *s, int i);
GK_HOT int gk_row_play_begin(const gk_forming *f, gk_system *s, const gk_row_block *b);
GK_HOT int gk_row_play_contradict(const gk_system *s, const gk_row_block *b, unsigned char *wrong);
GK_HOT void gk_row_play_flip(gk_system *s, int i);
GK_HOT double gk_row_play_twist(const gk_setup *setup, const gk_system *s, int i);
GK_HOT void gk_row_play_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b);
/* gk_row_clutch.c */
GK_HOT void gk_row_clutch_recall(const gk_forming *f, gk_system *s, int i);
GK_HOT void gk_row_clutch_read(const gk_forming *f, double h, gk_system *s, const gk_row_block *b);
GK_HOT int gk_row_clutch_begin(const gk_forming *f, gk_system *s, const gk_row_block *b);
GK_HOT int gk_row_clutch_contradict(const gk_system *s, const gk_row_block *b, unsigned char *wrong);
GK_HOT void gk_row_clutch_flip(gk_system *s, int i);
GK_HOT void gk_row_clutch_keep(const gk_setup *setup, const gk_engaged *engaged, gk_data *data, const gk_row_block *b);

static inline const gk_row_verbs *gk_verbs_of(gk_row_kind kind)
{
    static const gk_row_verbs verbs[] = {
        [ROW_CONTACT] = {NULL, gk_row_contact_read, gk_row_contact_begin, gk_row_contact_contradict,
                         gk_row_contact_flip, NULL, gk_row_contact_keep},
        [ROW_SPRING] = {NULL, gk_row_joint_read, gk_row_joint_begin, NULL, NULL, gk_row_joint_twist, gk_row_joint_keep},
        [ROW_PLAY] = {gk_row_play_recall, gk_row_joint_read, gk_row_play_begin, gk_row_play_contradict,
                      gk_row_play_flip, gk_row_play_twist, gk_row_play_keep},
        [ROW_TORQUE] = {NULL, gk_row_joint_read, gk_row_joint_begin_given, NULL, NULL, NULL, gk_row_joint_keep},
        [ROW_CLUTCH] = {gk_row_clutch_recall, gk_row_clutch_read, gk_row_clutch_begin, gk_row_clutch_contradict,
                        gk_row_clutch_flip, NULL, gk_row_clutch_keep},
    };
    return &verbs[kind];
}
#endif
