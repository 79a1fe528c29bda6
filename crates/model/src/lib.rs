//! Robot models: trees of bodies and joints, their files, and how algorithms walk them.
