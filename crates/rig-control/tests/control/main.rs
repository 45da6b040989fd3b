//! The control code from outside, each part by its equations and the whole on a rig whose every number is known. One program, so
//! that the table is fitted and the rig homed once.

mod bench;
mod constants;
mod drive_faults;
mod faults;
mod fixture;
mod friction_compensation;
mod homing;
mod load_state;
mod mechanism;
mod move_check;
mod moves;
mod observer;
mod planner;
mod position_loop;
mod rest;
mod streams;
