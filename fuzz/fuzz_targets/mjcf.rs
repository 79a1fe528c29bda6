//! Robots from MJCF.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Mjcf);
