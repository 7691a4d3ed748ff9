-- Displays that holograms are made for and kernels are learned from.
create table display (
    id             text    not null primary key check (length(id) between 1 and 63),
    -- every property, as JSON; the same text means the same display
    content        text    not null check (json_valid(content)),
    create_time_ms integer not null
) strict, without rowid;
