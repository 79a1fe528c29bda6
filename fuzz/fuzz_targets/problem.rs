//! Problems in files.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Problem);
