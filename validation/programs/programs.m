% A JSON line of each solver of Octave.  octave-cli programs.m
M=3.7;K=2.9;H=0.1;N=60; t=(0:N)'*H;
function out(name,scheme,q,v) printf('{"name":"%s","scheme":"%s","h":0.1,"m":3.7,"k":2.9,"q":[%s],"v":[%s]}\n',name,scheme,strjoin(cellfun(@(x) sprintf('%.17g',x),num2cell(q'),'UniformOutput',false),','),strjoin(cellfun(@(x) sprintf('%.17g',x),num2cell(v'),'UniformOutput',false),','));end
y=lsode(@(y,t)[y(2);-K/M*y(1)],[0.3;0.19],t); out('Octave 7.3, lsode','adaptive',y(:,1),y(:,2));
[tt,y]=ode45(@(t,y)[y(2);-K/M*y(1)],t,[0.3;0.19],odeset('RelTol',1e-3)); out('Octave 7.3, ode45','adaptive',y(:,1),y(:,2));
[tt,y]=ode23(@(t,y)[y(2);-K/M*y(1)],t,[0.3;0.19]); out('Octave 7.3, ode23','adaptive',y(:,1),y(:,2));
A=[0 1;-K/M 0]; z=[0.3;0.19]; Z=z'; P=expm(A*H); for i=1:N; z=P*z; Z=[Z;z']; end; out('Octave 7.3, expm','exact',Z(:,1),Z(:,2));
