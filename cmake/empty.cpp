// Only carries precompiled headers (lightloom_flavour).
