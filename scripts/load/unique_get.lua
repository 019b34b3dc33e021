-- wrk: GET of one address with a number behind it that grows, so that no answer was given before. Argument: key.

local counter = 0

function init(args)
  wrk.headers["Authorization"] = "Bearer " .. args[1]
end

function request()
  counter = counter + 1
  return wrk.format(nil, wrk.path .. counter)
end
