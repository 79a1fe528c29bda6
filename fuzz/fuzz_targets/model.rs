//! Fuzzes the reader of models from JSON.
#![no_main]

condyle_fuzz::target!(condyle_fuzz::Kind::Model);
