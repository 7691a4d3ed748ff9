-- Kernels that vary over the modulator: displays of which a single transfer function does not tell all.
alter table kernel_version
add column varies integer not null default 0 check (varies = 0 or varies = 1 and model = 'display');
